"""Writes docs/mutants.md of what scripts/mutants found."""

HEAD = """# Mutants of the safety core

Made by `scripts/mutants`: one change at a time in a source of the safety core; then the tests that cover it must fail.
Changed are comparisons, operators, signs, conditions (negated), choices (`?` always the one or the other), numbers (integers by
one, others by a tenth, zero to one), `true` and `false`, `min` and `max`, named constants (another one of the same kind), statements
and rows of a table (removed). Texts are not changed. What compiles (`-O1`) to the same machine code is no mutant. Where a file has
more mutants than were tried, a seeded sample was. *Killed* counts all that compiled to other code, explained survivors included.

| file | mutants | tried | did not build | same code | killed | survived | of which explained | killed |
|---|---|---|---|---|---|---|---|---|
"""


def explanation(plan, file, mutant):
    for entry in plan['explained']:
        if entry['file'] == file and entry.get('line', mutant['code']) == mutant['code'] and \
                entry['change'] in ('*', mutant['change']):
            return entry['why']
    return None


def share(killed, survived):
    return f'{100.0 * killed / (killed + survived):.1f} %' if killed + survived else '-'


def page(records, plan):
    text, survivors, sums = HEAD, '', [0] * 7
    for record in records:
        counts = [sum(m['verdict'] == v for m in record['mutants'])
                  for v in ('did not build', 'same code', 'killed', 'survived')]
        lived = [m for m in record['mutants'] if m['verdict'] == 'survived']
        reasons = [explanation(plan, record['file'], m) for m in lived]
        row = [record['possible'], len(record['mutants']), *counts, sum(r is not None for r in reasons)]
        sums = [a + b for a, b in zip(sums, row)]
        text += f'| `{record["file"]}` | ' + ' | '.join(map(str, row)) + f' | {share(row[4], row[5])} |\n'
        for mutant, reason in zip(lived, reasons):
            code = mutant['code'].replace('|', '\\|')
            change = mutant['change'].replace('|', '\\|')
            survivors += f'| `{record["file"]}` | `{code}` | {change} | {reason or "**not explained**"} |\n'
    text += '| **all** | ' + ' | '.join(map(str, sums)) + f' | {share(sums[4], sums[5])} |\n'
    return text + '\n## Survivors\n\n| file | line | change | why it is no gap |\n|---|---|---|---|\n' + survivors
