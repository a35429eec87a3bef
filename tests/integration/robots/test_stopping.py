"""Motors are switched off from whatever thread, while the driver's own is busy."""

from threading import Event, Thread

from swarmwire.agent.drivers.driver import Command
from swarmwire.agent.on_robot.watchdog import Watchdog
from tests.support.robots.rig import Rig
from tests.support.waiting import until


def test_another_thread_stops_the_motors_while_this_one_reads(connected: Rig) -> None:
    driver, done = connected.driver, Event()
    driver.act(Command(0.05, 1.0))
    connected.until_told(0.05, 1.0)

    def read() -> None:
        while not done.is_set():
            driver.sense(driver.gives)

    reader = Thread(target=read)
    reader.start()
    driver.stop()
    connected.until_told(0.0, 0.0)
    done.set()
    reader.join()
    assert all(connected.same_speeds(speeds, (0.0, 0.0)) for speeds in connected.told().speeds)


def test_a_stopped_robot_drives_on_with_the_next_command(connected: Rig) -> None:
    connected.driver.act(Command(0.05, 0.0))
    connected.driver.stop()
    connected.driver.act(Command(0.03, 0.0))
    connected.until_told(0.03, 0.0)


def test_a_watchdog_stops_a_robot_whose_agent_falls_silent(connected: Rig) -> None:
    watchdog = Watchdog(0.1, connected.driver.stop, connected.clock)
    watchdog.start()
    try:
        connected.driver.act(Command(0.05, 1.0))
        watchdog.feed()
        connected.until_told(0.05, 1.0)
        connected.until_told(0.0, 0.0)
        until(lambda: watchdog.stops == 1)
    finally:
        watchdog.end()


def test_to_stop_a_robot_that_is_not_connected_does_nothing(rig: Rig) -> None:
    driver = rig.made_driver(rig.address)
    driver.stop()
    driver.close()
    driver.stop()
    assert rig.told().speeds == []
