#!/usr/bin/env python3
"""Makes docs/ros_campaign.md from what the campaign injected and what the monitor found; for scripts/ros_campaign.

Exit status 1 when a frame of the pilot's was unsafe or there was nothing to judge. With --bad-sender LOG, 0 only when every
frame of the bad sender's in that log was found for what it breaks: the angle leaps, and where another of its own came just
before, the counter stands.
"""
import argparse
import json
import sys

# What no run tells by itself; not about the run at hand.
NOTES = """## Waits in vain

Simulated time stands still until the bridge has said what is due. It says nothing where what drives would be older than its limit once it is
on the bus ([can.md](can.md), "What the bridge sends"): the next tick has news, or stops. In the run of seed 24 all 30 waits were followed by a set in the next tick of
10 ms; one was looked at closely, and the command was 100 ms old.

## Runs

Seeds 28 and 29, with the stages in one thread: 100,002 and 100,000 injections, no unsafe frame (seed 29 also with an arbiter that forgets the
walls passed when odometry jumps: the truck came to drive 1,225 times, not 788 to 1,006). Seeds 24, 25 and 26, before: 100,006, 100,001 and 100,002, none.

## What runs found

- `counter`, `rate`, `source not told`, six frames of seed 27: a command of the second publisher asked for a stop and named a source above 15, for
  which TP_COMMAND_INFO has no room. The bridge took it, and each of its sets broke off behind TP_COMMAND; to the bridge the bus had refused
  them, so it began each angle at the measured one. Commands with codes that nobody knows are refused now (the stop counts), and of a bus that takes the
  command alone the angle that went out counts. Before, the arbiter's next command had as a rule come soon enough.
- `old measurement`, six frames of seed 23: a spoilt scan between two that are the same made the second one fresh, and one from the future was
  waited for until it was of the present. The filter compares with the last scan that could be used now, and what is more than
  50 ms ahead is not waited for.
- No frame, but ten minutes of simulated time without a tunnel in a run of fifty: one odometry message stamped a day ahead kept out all that came after it, in `centerline` and, where
  `joint_states` lied alike, in the arbiter, until the clock jumped. Motion that far ahead is refused (`MotionHistory`).
- `source not told`, one frame of seed 22, was the campaign's: the bridge, held up for 240 ms, was told of a stop before the clock told it the
  time. With a wall clock it knows the time as soon as it goes on; so the campaign tells it that first.
- `old measurement`, two frames of seed 22: bad scans, a jump of the clock that made the scan filter forget what the lidar had said last, then frozen
  scans. It remembers that now, and one identical scan is too many (`frozen_count`).
- `period`: the bridge's count of its frames of the last 250 ms believed its clock. A jump emptied it; later, when it moved with jumps back, one
  forward and back still made room. Now the count has a time of its own (`CommandSender::pass`).
- `no stop bit`: `can_bridge` kept one waiting command only, and a newer one could push a stop out of it. It keeps ten.
- `counter`: frames were missing in the log. The kernel keeps eleven datagrams for a socket, and while the campaign waited for a service, the bridge
  could say more than that. A thread fetches them now.
- The campaign's own: simulated time went on though the bridge had not yet been handed the arbiter's stop (now it stands still until that is told);
  a bridge that had been held up lived through every tick that it had missed, all at once (a wall clock shows it one jump, and so does the campaign now);
  and a second publisher named a driver and a stamp of right now, a lie that nobody can find. Against him the publisher is pinned
  ([security.md](security.md)); he is somebody else now.
"""

parser = argparse.ArgumentParser(description=__doc__)
parser.add_argument('report')
parser.add_argument('judged')
for name in ('seed', 'asked'):
    parser.add_argument(f'--{name}', type=int, required=True)
parser.add_argument('--python', required=True, help='what the monitor ran in')
parser.add_argument('--bad-sender', metavar='LOG')
options = parser.parse_args()
with open(options.report, encoding='utf-8') as file:
    report = json.load(file)
with open(options.judged, encoding='utf-8') as file:
    judged = json.load(file)


def table(title, counts):
    rows = '\n'.join(f'| {name} | {count} |' for name, count in sorted(counts.items(), key=lambda item: -item[1]))
    return f'| {title} | times |\n|---|---|\n{rows}\n'


driven = report['injections']
of = '' if driven >= options.asked else f' (of {options.asked} asked for)'
unsafe = judged['unsafe_frames']
print(f'''# Fault campaign at the level of ROS

Made by `scripts/ros_campaign --injections {options.asked} --seed {options.seed}`: the nodes of `pilot.launch` (the nodelets in their
manager, `can_bridge` a process), with the simulator's truck and world in lockstep, in simulated time. An injection is one
faulty message, a scan withheld, a call, a jump of the clock, a pause, or a process killed, held up or unloaded. They come
in bursts, as a rule of several kinds, while the truck drives; between them the operator resets and engages. The seed draws the
faults; when exactly a message arrives is the machine's, so two runs are alike, not the same. The independent monitor
([can.md](can.md), "Unsafe frames") judges every frame on the bus: by the campaign's own log of which scans were good,
what the operator asked for and when the arbiter asked for a stop. The bridge's clock comes in ticks of 10 ms, of which every other
one is not waited for; so the monitor takes the log's times to be up to 20 ms late (`--jitter 20`), and its limits in
milliseconds are that much wider than in the campaign in virtual time ([fault_campaign.md](fault_campaign.md)).

| what | |
|---|---|
| injections | {driven}{of}, in {report['bursts']} bursts |
| times that the truck came to drive | {report['engaged']} |
| judged | {judged['frames']} frames, {judged['pilot_frames']} under the pilot's identifiers, in {options.python} |
| **unsafe frames** | **{unsafe}** |
| waits of 1 s in vain for a frame of the bridge | {report['late_sets']} |
| longest time between two of its sets, where it was not started anew | {judged['longest_silence_ms']:.0f} ms |
| contacts of the truck with a wall | {report['contacts']} |
| time | {report['simulated_seconds']:.0f} s simulated in {report['seconds']:.0f} s |
''')
print(table('injections', report['kinds']))
print(table("safety state when injected, as the campaign knew it", report['states']))
print(table('stops, by the reason that the bridge gave', report['stops']))
if unsafe:
    print(table('unsafe because', judged['reasons']))
    for finding in judged['unsafe'][:20]:
        print('- {time:.6f} s: {kind}, {detail}, `{frame}`'.format(**finding))
print(NOTES)
if options.bad_sender:
    bad = report['bad_frame']
    with open(options.bad_sender, encoding='utf-8') as file:
        sent = sum(line.split()[-1] == bad for line in file)
    found = {f['time'] for f in judged['unsafe'] if f['frame'] == bad and (f['clause'], f['kind']) in (('b', 'rate'), ('a', 'counter'))}
    print(f'\nThe bad sender sent {sent} frames, {len(found)} were found for the angle or the counter.')
    sys.exit(0 if sent and len(found) == sent else 1)
sys.exit(1 if unsafe or not judged['pilot_frames'] else 0)
