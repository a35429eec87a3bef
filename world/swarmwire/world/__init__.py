"""The world: the truth of a run, and the loop that advances it tick by tick.

One tick (`loop.Loop.step`), with the calls in their order:

    Loop.begin_tick
    |-- LiveEvents.pop_due          starts and ends of live events                live_events.py
    |-- EventScheduler.apply        due events -> World, radio medium             event_scheduler.py
    |-- RadioMedium.step            receptions, fates, tx statuses so far         comms/radio/medium.py
    |-- Mailbox.pop_packets         packets of the robots that act                loop.py
    |-- Mailbox.pop_tx_statuses     tx statuses of the robots that act            loop.py
    `-- World.sense                 readings of the robots that act               world.py
        `-- SensorPipeline.read     rate, errors, delay                           sensors/pipeline.py
            `-- Sensor.truth        undisturbed values                            sensors/sensor.py

    Loop.end_tick
    |-- AgentBackend.act            readings, packets -> actions                  comms/observe/interfaces.py
    |-- RadioMedium.send            packets of the actions                        comms/radio/medium.py
    |-- World.move                  actions -> motion                             world.py
    |   |-- Actuators.apply         limits, wheel noise, failures -> targets      actuation/actuators.py
    |   |-- States.update           states that agents reported                   annotations.py
    |   |-- LatestValues.update     values that agents reported                   annotations.py
    |   |-- CustomActuators.act     users' actuators                              custom/actuators.py
    |   |-- Batteries.drain         energy of the tick                            actuation/batteries.py
    |   `-- Physics.tick            targets -> poses, contacts                    engines/physics.py
    |       `-- Engine.tick         one engine per group                          engines/engine.py
    |-- TrajectoryHash.add          poses, commands, receptions                   trajectory_hash.py
    |-- Observer.see                metrics, records and views get the Truth      comms/observe/interfaces.py
    |-- StopConditions.done         arenas in which a stop condition holds        comms/observe/interfaces.py
    `-- Loop.leave                  removal of these arenas                       loop.py

In real time with sub-ticks, `subtick.py` stands between loop and medium, so that packets also cross within a tick.

Before the first tick:

    load_scenario                   TOML file + overrides -> Scenario             scenario_file.py, scenario/
    `-- check                       checks across keys                            validation.py
    World(scenario, seeds, needs)                                                 world.py
    |-- read_layout, place_arena    map, obstacles, lights, robots                placement/
    |-- Physics                     an engine per kind of motion                  engines/
    `-- sensor_of                   the sensors that agents need                  sensors/loading.py

Agents run in this process (`agent/local_backend.py`) or behind the network (`backends/`). `events/` holds the kinds of
events; `engines/discs/` the default engine; `gateways/` connects programs that speak a real robot's protocol,
`interfaces/` programs on network interfaces of robots.
"""
