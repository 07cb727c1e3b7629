#!/usr/bin/env python3
"""Makes a table of what latency.launch left in a folder, and the rows that scripts/benchmark judges.
usage: report.py FOLDER [--json FILE]"""
import json
import statistics
import sys
from collections import Counter, defaultdict
from pathlib import Path

NODES = 5  # of the peer
PILOTS = {'preview': 'preview_driver steers', 'lidar': 'lidar_driver steers'}
PEERS = {'peer': 'five nodes, usual settings', 'light': 'five nodes, light settings'}

WAYS = {'preview': ['pilot_arrived', 'points', 'walls', 'tunnel_state', 'preview_proposal', 'pilot_published'],
        'lidar': ['pilot_arrived', 'points', 'lidar_proposal', 'pilot_published']}


def read(folder):
    """By event, what is known of each scan [us]. Of events that come more than once the first counts: the
    arbiter says a scan's command again with every tick of its timer. CPU times of the five nodes are added."""
    events, nodes = defaultdict(dict), Counter()
    for file in folder.glob('*.log'):
        for line in file.read_text().splitlines():
            event, scan, value = line.split()
            if event == 'peer_cpu':
                nodes[scan] += 1
                events[event][scan] = events[event].get(scan, 0) + int(value) / 1e3
            else:
                events[event].setdefault(scan, int(value) / 1e3)
    whole = {scan: cpu for scan, cpu in events['peer_cpu'].items() if nodes[scan] == NODES}
    return {**events, 'peer_cpu': whole}


def between(events, scans, start, end):
    return [events[end][scan] - events[start][scan]
            for scan in scans if scan in events[start] and scan in events[end]]


class Times:
    def __init__(self, what, values):
        if not values:
            raise SystemExit(f'nothing measured: {what}')
        values = sorted(values)
        self.what, self.scans, self.worst = what, len(values), values[-1]
        self.median, self.p99 = (values[int(share * len(values))] for share in (0.5, 0.99))

    def __str__(self):
        return f'| {self.what} | {self.scans} | {self.median:.0f} | {self.p99:.0f} | {self.worst:.0f} |'


def measured(events):
    """Times by (kind, whose)."""
    times = {}
    for who, what in PILOTS.items():
        scans = events[f'{who}_received']
        times['inside', who] = Times(f'{what}: scan arrived → command published',
                                     between(events, scans, 'pilot_arrived', 'pilot_published'))
        times['outside', who] = Times(f'{what}: scan sent → command received',
                                      between(events, scans, 'pilot_sent', f'{who}_received'))
    for who, what in PEERS.items():
        scans = events[f'{who}_sent']
        times['inside', who] = Times(f'{what}: scan arrived → command published',
                                     between(events, scans, 'peer_arrived', 'peer_published'))
        times['outside', who] = Times(f'{what}: scan sent → command received',
                                      between(events, scans, f'{who}_sent', 'peer_received'))
        times['cpu', who] = Times(f'{what}: CPU time of their callbacks',
                                  [events['peer_cpu'][scan] for scan in scans if scan in events['peer_cpu']])
    for who, what in PILOTS.items():
        times['cpu', who] = Times(f"{what}: CPU time of the pilot's stages",
                                  [cpu for scan, cpu in events[f'{who}_cpu'].items() if scan in events['compute_sent']])
    return times


def ways(events):
    """Where the time goes: from one message's publication to the next."""
    for who, way in WAYS.items():
        hops = (statistics.median(between(events, events[f'{who}_received'], *hop)) for hop in zip(way, way[1:]))
        steps = ''.join(f' → {median:.0f} → {event}' for median, event in zip(hops, way[1:]))
        yield f'{PILOTS[who]}, medians: {way[0]}{steps}'


def rows(times):
    for kind in ('inside', 'outside'):
        for who, what in PILOTS.items():
            for peer, settings in PEERS.items():
                theirs, ours = times[kind, peer].median, times[kind, who].median
                judged = kind == 'inside' and peer == 'peer'
                yield {'what': f'{what.split()[0]}, {kind}; {settings.split(", ")[1]}', 'unit': 'us', 'peer': theirs,
                       'ours': ours, 'ratio': theirs / ours, 'met': not judged or theirs >= 10 * ours,
                       'goal': 'at least 10 times as fast' if judged else ''}
    for who, what in PILOTS.items():
        p99 = times['cpu', who].p99
        yield {'what': f'{what.split()[0]}, compute alone, p99', 'unit': 'us', 'peer': 200, 'ours': p99,
               'ratio': 200 / p99, 'goal': 'at most 200', 'met': p99 <= 200}


def lost(events):
    """Scans without an answer, of those sent to each."""
    for name, sent, answers in (('pilot', ('pilot_sent',), ('preview_received', 'lidar_received')),
                                ('five nodes', ('peer_sent', 'light_sent'), ('peer_received',)),
                                ('one thread', ('compute_sent',), ('preview_cpu', 'lidar_cpu'))):
        asked = {scan for event in sent for scan in events[event]}
        answered = {scan for event in answers for scan in events[event]}
        yield f'{name} {len(asked - answered)} of {len(asked)}'


folder = Path(sys.argv[1])
events = read(folder)
times = measured(events)
print('| [us] | scans | median | p99 | worst |\n|---|---|---|---|---|')
print('\n'.join(str(row) for row in times.values()))
print('\n' + '\n\n'.join(ways(events)))
print(f'\nScans without a command: {", ".join(lost(events))}. Stops of the truck: {len(events.get("stop", ()))}.')
if sys.argv[2:3] == ['--json']:
    Path(sys.argv[3]).write_text(
        json.dumps({'work': 'latency', 'rows': list(rows(times)), 'counted': [], 'missing': []}))
