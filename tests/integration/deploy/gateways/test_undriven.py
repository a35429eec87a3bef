"""People are told of robots behind gateways that nobody drives, soon after the start and at the end."""

import pytest

from swarmwire.deploy import Recording, Simulation
from swarmwire.deploy.gateways import undriven

BARE = Recording(tables=False, rrd=False)


@pytest.mark.parametrize("driven", [(), (1,), (0, 1, 2)])
def test_people_are_told_whom_nobody_drives(scenario, scripted, tmp_path, capsys, monkeypatch, driven) -> None:
    monkeypatch.setattr(undriven, "GRACE_S", 0.01)  # wall time: the tenth tick
    out = tmp_path / "run"
    with Simulation(scenario, gateways={"other": "scripted"}, realtime=100, out=out, record=BARE) as simulation:
        scripted[-1].drive = dict.fromkeys(driven, (0.0, 0.0))
        simulation.run(15)
        early = [line for line in capsys.readouterr().err.splitlines() if "nobody dr" in line]
    late = [line for line in capsys.readouterr().err.splitlines() if "nobody dr" in line]
    names = [f"other-{place}" for place in range(3) if place not in driven]
    if not names:
        assert early == late == []
        return
    rest = f"{', '.join(names)}: swarmwire-agent run --config {out}/robots/{names[0]}.toml and so on"
    assert (early, late) == ([f"nobody drives {rest}"], [f"nobody drove {rest}"])


def test_what_is_said_soon_is_said_in_wall_time(scenario, scripted, capsys) -> None:
    with Simulation(scenario, gateways="scripted", realtime=100) as simulation:
        simulation.run(15)
        assert "nobody dr" not in capsys.readouterr().err


def test_few_are_named(scenario, scripted, capsys) -> None:
    many = ["robots.other.count=8"]
    with Simulation(scenario, gateways={"other": "scripted"}, realtime=100, overrides=many) as simulation:
        simulation.run(1)
    (line,) = [line for line in capsys.readouterr().err.splitlines() if "nobody dr" in line]
    assert line == "nobody drove other-0, other-1, other-2, other-3, other-4, other-5 and 2 more"


def test_one_that_dies_or_is_revived_comes_to_rest_undriven(scenario, scripted, capsys) -> None:
    events = [
        "events=[{at_s=0.2, do='kill', robots={group='other'}}, {at_s=0.6, do='revive', robots={group='other'}}]",
    ]
    with Simulation(scenario, gateways={"other": "scripted"}, realtime=100, overrides=events) as simulation:
        for tick in (2, 6):  # as gateways tell it: with the first readings after
            simulation.run(tick)
            scripted[-1].drive = dict.fromkeys(range(3), (0.0, 0.0))
            simulation.run(tick + 1)
    assert "nobody drove other-0" in capsys.readouterr().err
