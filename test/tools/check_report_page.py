#!/usr/bin/env python3
"""Checks the page of a report against what stands beside it: check_report_page.py FOLDER.

The page must be well-formed, need nothing beside itself, and hold the figures of summary.json. Prints what is
wrong; exit status 1 then.
"""
import json
import sys
import xml.etree.ElementTree as ET
from pathlib import Path

folder = Path(sys.argv[1])
text = (folder / 'report.html').read_text()
summary = json.loads((folder / 'summary.json').read_text())
page = ET.fromstring(text)
wrong = []


def expect(holds, words):
    if not holds:
        wrong.append(words)


def figures(cells):
    """SI values of the cells' figures, None where there is none."""
    return [None if cell.find('data') is None else float(cell.find('data').get('value')) for cell in cells]


def alike(shown, wanted):
    if shown is None or wanted is None:
        return shown is None and wanted is None
    return abs(shown - wanted) <= 1e-8 * max(1.0, abs(wanted))


for outside in ('http:', 'https:', '<script', '<link', '@import', 'url('):
    expect(outside not in text, f'it names {outside}')
for element in page.iter():
    for name in ('src', 'href'):
        expect(element.get(name, 'data:').startswith('data:'), f'{name} of {element.tag} lies outside')
expect(len(page.findall('.//img')) == min(2, len(summary['episodes'])), 'pictures are missing')

goals = page.findall(".//table[@id='goals']/tr")[1:]
expect(len(goals) == len(summary['goals']), 'goals are missing')
for row, goal in zip(goals, summary['goals']):
    median, worst = figures(row.findall('td')[3:5])
    expect(alike(median, goal['median']) and alike(worst, goal['worst']), f"{goal['metric']} differs")
    verdict = row.findall('td')[-1].text
    wanted = '-' if goal['judge'] == 'report_only' else 'ok' if goal['holds'] else 'MISSED'
    expect(verdict == wanted, f"{goal['metric']}: {verdict} instead of {wanted}")
    expect(len(row.findall('.//circle')) == len(summary['episodes']), f"{goal['metric']}: episodes are missing")

keys = sorted({key for episode in summary['episodes'] for key in episode['metrics']})
episodes = page.findall(".//table[@id='episodes']/tr")[1:]
expect(len(episodes) == len(summary['episodes']), 'episodes are missing')
for row, episode in zip(episodes, summary['episodes']):
    label, ending = (cell.text for cell in row.findall('td')[:2])
    expect(label == f"seed {episode['seed']}" + (' reversed' if episode['reversed'] else ''), f'{label} differs')
    expect(ending == episode['ending'], f'ending of {label} differs')
    for key, value in zip(keys, figures(row.findall('td')[2:])):
        expect(alike(value, episode['metrics'].get(key)), f'{key} of {label} differs')

for what, sha256 in summary['sha256'].items():
    expect(sha256 in text, f'the SHA-256 of {what} is missing')

print('\n'.join(wrong))
sys.exit(1 if wrong else 0)
