"""The emulated radio: the medium that carries every packet, in one of two models.

The world's loop calls `step` and then `send` in each tick. What these call, and in which files:

    RadioMedium.send                 medium.py                 packets of a tick go to the senders' radios
    |  SendTimes.of_senders          send_times.py             the moment of each within the tick
    |  RadioModel.accept             model.py                  of the unit disk or of the PHY:
    |  |  admit                      transmissions.py          a row of type PACKET each; UNDER_WAY: no fate yet
    |  +- unit disk
    |  |     enqueue                 unit_disk/tx_queue.py     the time on air, or a refusal, is known at once
    |  +- PHY
    |        PacketTable.accept      phy/packets.py            packets wait for their events

    RadioMedium.step                 medium.py                 time passes up to the start of the tick
    |  poses_between                 positions.py              only if positions are interpolated: ten times
    |  RadioModel.pass_time          model.py                  appends links with fates:
    |  +- unit disk
    |  |     UnitDisk.pass_time      unit_disk/model.py
    |  |     find_neighbours         unit_disk/neighbours.py   the robots in range of each other
    |  |     decide                  unit_disk/model.py        one walk over the receivers of the packets that
    |  |     leave_queue             unit_disk/tx_queue.py     go on air, or are refused; for each receiver:
    |  |     fate_before_reception   stages/chain.py
    |  |        is_out_of_sight, is_behind_bodies, disrupted_fate   stages/blocking.py
    |  |        loss_fate            stages/losses.py          the first loss that ends it:
    |  |           fixed_loss        stages/loss.py
    |  |           burst_loss        stages/burst_loss.py
    |  |           trace_loss        stages/trace.py
    |  |     after_reception         stages/chain.py           of a packet that is received:
    |  |        measured_range_m, measured_bearing_rad, measured_rssi_dbm   stages/measurements.py
    |  |        trace_delay_ns       stages/trace.py
    |  |        latency_ns, frame_delay_ns, propagation_delay_ns   stages/delays.py
    |  |     fill_remainder          links.py                  a row for the receivers out of range
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
    |        run_until               phy/esb.py                with a station that polls, in place of phy/mac.py
    |        run_until               phy/advertising.py        with advertising events and scans, in place of phy/mac.py
    |        append_results          phy/packets.py            these rows as packets and links
    |        pass_received           phy/model.py              `after_reception` of each, as above
    |  RadioModel.disrupt            model.py                  only while robots are dead or radios off
    |  final_by                      results.py                results of links whose fates are final by now
    |  Liveness.apply                liveness.py               disruption of the new tick
    |  RadioModel.set_poses          model.py                  poses of the new tick
    |  RadioModel.edges              model.py                  radio graph under these poses

A PHY of 802.11n has the events of `phy/ht/events.py` in place of those of `phy/mac.py` and `phy/tx_queue.py`.

`RadioMedium.advance` and `send_at` do the same for a part of a tick. `context.py` holds what both models and all stages
get: the radio, the arenas and the robots. `config/` has the parameters of a radio, `propagation/` and `reception/` the
formulas of the PHY, `analysis/` computations without a run.
"""
