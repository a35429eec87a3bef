"""The emulated radio: the medium that carries every packet, in one of two models.

The world's loop calls `step` and then `send` in each tick. What these call, and in which files:

    RadioMedium.send                 medium.py                 packets of a tick go to the senders' radios
    |  SendTimes.in_tick             send_times.py             the moment of each robot within the tick
    |  RadioModel.accept             model.py                  of the unit disk or of the PHY:
    |  |  Admission.admit            transmissions.py          a row of `Transmissions` each; UNDER_WAY: no fate yet
    |  +- unit disk
    |  |     TxQueues.accept         unit_disk/tx_queue.py     the time on air, or a refusal, is known at once
    |  +- PHY
    |        PacketTable.add         phy/packets.py            packets wait for their events
    |  PacketCounters.count_sent     counters.py

    RadioMedium.step                 medium.py                 time passes up to the start of the tick
    |  RadioModel.pass_time          model.py                  packets, and their links with fates
    |  +- unit disk
    |  |     UnitDisk.pass_time      unit_disk/model.py
    |  |     TxQueues.pop_due        unit_disk/tx_queue.py     packets that go on air
    |  |     Channel.decide          unit_disk/model.py        the fates of these packets:
    |  |     links_in_range          unit_disk/neighbours.py   their receivers in range
    |  |     Links.with_remainders   links.py                  a row per packet and receiver, UNDER_WAY
    |  |     Stage.decide            stages/stage.py           of each stage in stages/chain.py, in order:
    |  |        LineOfSight, BodiesBlock, Disrupted            stages/blocking.py
    |  |        LossStage, ReceptionStage                      stages/losses.py
    |  |        Measurement                                    stages/measurements.py
    |  |        TraceDelay                                     stages/trace.py
    |  |        Latency, VaryingDelay, PropagationDelay        stages/delays.py
    |  +- PHY
    |        SinrPhy.pass_time       phy/model.py
    |        run_until               phy/mac.py                events in the order of time:
    |           enqueue              phy/tx_queue.py           a packet arrives at the queue, or is refused
    |           serve                phy/tx_queue.py           the next packet of the queue
    |           begin_attempt        phy/tx_queue.py           an attempt at it, or a wait until the radio is on
    |           request_access       phy/csma.py, phy/dcf.py   channel access: the packet waits for its turn
    |           send                 phy/mac.py                the packet goes on air
    |           start_frame          phy/reception.py          receivers lock to it, or it is interference
    |           frame_ended          phy/mac.py                the frame of a packet or an acknowledgement ends
    |           end_frame            phy/reception.py          SINR over its chunks, then the losses:
    |           frame_fate           stages/losses.py          of a frame without errors: first loss, or RECEIVED
    |           record_frame         phy/results.py            rows of fates; schedules the acknowledgement
    |           send_ack             phy/mac.py                the receiver acknowledges the frame
    |           ack_timed_out        phy/mac.py                no acknowledgement: retry, or end the packet
    |           record_last_attempt  phy/results.py            a unicast packet ends with this fate
    |        links_of_rows           phy/packets.py            these rows as links
    |        chain_after_reception   stages/chain.py           measurements and delays, as above
    |  OpenLinks.add                 links.py                  stored until their fates are final
    |  RadioModel.disrupt            model.py                  only while robots are dead or radios off
    |  final_by                      results.py                results of links whose fates are final by now
    |  Liveness.apply                liveness.py               disruption of the new tick
    |  RadioModel.set_poses          model.py                  poses of the new tick
    |  RadioModel.edges              model.py                  radio graph under these poses

`RadioMedium.advance` and `send_at` do the same for a part of a tick. `context.py` holds what both models and all stages
get: the radio, the arenas and the robots. `config/` has the parameters of a radio, `propagation/` and `reception/` the
formulas of the PHY, `analysis/` computations without a run.
"""
