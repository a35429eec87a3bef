"""The antennas of robots: their own where their group has any, else the radio's."""

from swarmwire.comms.air.antennas import Antennas
from swarmwire.comms.air.parameters.propagation import Antenna, OwnAntenna

RADIO = Antenna(10.0, 2.0)


def test_robots_without_anything_of_their_own_have_the_radios():
    alike = Antennas.alike(2)
    assert alike.send_dbm(RADIO).tolist() == [12.0, 12.0]
    assert alike.receive_dbi(RADIO).tolist() == [2.0, 2.0]


def test_groups_have_their_own_power_or_gain_or_both():
    groups = [(1, OwnAntenna(power_dbm=0.0)), (2, OwnAntenna(gain_dbi=-1.0)), (1, None), (1, OwnAntenna(1.0, 1.0))]
    mixed = Antennas.of_groups(groups)
    assert mixed.send_dbm(RADIO).tolist() == [2.0, 9.0, 9.0, 12.0, 2.0]
    assert mixed.receive_dbi(RADIO).tolist() == [2.0, -1.0, -1.0, 2.0, 1.0]
