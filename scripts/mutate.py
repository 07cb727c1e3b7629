"""Makes mutants of a C++ source: small changes that a test should notice. Works on the text, outside comments and
strings, and relies on clang-format's spaces to tell `a < b` from `vector<int>`. What does not compile is sorted
out later. universalmutator (PyPI) was tried first: it changes lines by general patterns, 478 mutants of the 39 lines
of protection.cpp, too many of which do not build."""
import re
from dataclasses import dataclass

OPERATORS = {
    '<': ('<=', '>='), '<=': ('<', '>'), '>': ('>=', '<='), '>=': ('>', '<'), '==': ('!=',), '!=': ('==',),
    '&&': ('||',), '||': ('&&',), '+': ('-',), '-': ('+',), '*': ('/',), '/': ('*',), '%': ('/',),
    '<<': ('>>',), '>>': ('<<',), '&': ('|',), '|': ('&',), '^': ('|',),
    '+=': ('-=',), '-=': ('+=',), '*=': ('/=',), '/=': ('*=',),
}
WORDS = {'true': 'false', 'false': 'true', 'min': 'max', 'max': 'min', 'any_of': 'all_of',
         'min_element': 'max_element', 'max_element': 'min_element'}
HIDDEN = re.compile(r'//[^\n]*|/\*.*?\*/|"(?:\\.|[^"\\\n])*"|\'(?:\\.|[^\'\\\n])\'|^[ \t]*#[^\n]*', re.S | re.M)
NUMBER = re.compile(r"(?<![\w.'])(0x[0-9A-Fa-f]+|\d+\.\d*(?:e[+-]?\d+)?|\d+e[+-]?\d+|\d+)(?![\w.'])")
ENUM = re.compile(r'\b([A-Z]\w*)::(k[A-Z]\w*)\b')
ROW = re.compile(r'^[ \t]*\{.*\},$', re.M)
# What may stand before a statement: a block, another statement, a condition, `else`, a case.
STATEMENT = re.compile(r'(?=(?:(?<=[{};:])|(?<=\belse)|(?<=\)))\s+(?=[\w+*-])([^;{}]*?(?:\{[^;{}\n]*\}[^;{}]*?)?);(?=\s))')
KEYWORD = re.compile(r'(?:return|const|constexpr|static|auto|using|template|typename|struct|class|enum|case|namespace|'
                     r'public|private|throw|default|friend|explicit|virtual)\b')
DECLARATION = re.compile(r'[\w:]+(?:<[^;=]*>)?[&*]* [&*]?\w+(?: =|\(|\{|,|$|\[)')


@dataclass(frozen=True)
class Mutant:
    start: int
    end: int
    text: str  # instead of what stands there
    kind: str
    line: int
    code: str    # the line, for those who read
    change: str

    def apply(self, source):
        return source[:self.start] + self.text + source[self.end:]


def masked(source):
    """The source with comments, strings and directives blanked."""
    return HIDDEN.sub(lambda m: re.sub(r'[^\n]', ' ', m.group()), source)


def closing(text, opening):
    """Where the parenthesis that opens there closes."""
    depth = 0
    for i in range(opening, len(text)):
        depth += {'(': 1, ')': -1}.get(text[i], 0)
        if depth == 0:
            return i
    raise ValueError('unbalanced parenthesis')


def operators(text):
    for m in re.finditer(r'(?<=\s)(<=|>=|==|!=|<<|>>|&&|\|\||\+=|-=|\*=|/=|[<>+*/%&|^-])(?=\s)', text):
        for other in OPERATORS[m.group()]:
            yield m.start(), m.end(), other, 'operator'
    for m in re.finditer(r'(?<=[\s(\[{,])-(?=[\w(])', text):
        yield m.start(), m.end(), '', 'sign'
    for m in re.finditer(r'\+\+|--', text):
        yield m.start(), m.end(), '--' if m.group() == '++' else '++', 'operator'
    for m in re.finditer(r'!(?=[\w(*])', text):
        yield m.start(), m.end(), '', 'negation'


def conditions(text):
    for m in re.finditer(r'\b(if|while) \(', text):
        opening, end = m.end() - 1, closing(text, m.end() - 1)
        declared = re.match(r'\((?:const|auto)\b[^=]*?(\w+) = ', text[opening:end])
        if declared:
            yield end, end, f'; !{declared.group(1)}', 'condition'
        else:
            yield opening + 1, end, f'!({text[opening + 1:end]})', 'condition'
    for m in re.finditer(r'(?<=\s)\?(?=\s)', text):
        yield m.start(), m.end(), '&& false ?', 'choice'
        yield m.start(), m.end(), '|| true ?', 'choice'


def numbers(text):
    for m in NUMBER.finditer(text):
        word = m.group()
        if word.startswith('0x') or word.isdigit():
            value = int(word, 8 if re.fullmatch('0[0-7]+', word) else 0)
            others = (str(value + 1), str(value - 1))
        elif float(word) == 0.0:
            others = ('1.0', '-1.0')
        else:
            others = (repr(float(word) * 1.1), repr(float(word) * 0.9))
        for other in others:
            yield m.start(), m.end(), other, 'number'


def words(text):
    for m in re.finditer(r'\b(' + '|'.join(WORDS) + r')\b', text):
        if m.group() in ('min', 'max') and not text.startswith('(', m.end()):
            continue
        yield m.start(), m.end(), WORDS[m.group()], 'word'
    names = {}
    for m in ENUM.finditer(text):
        names.setdefault(m.group(1), []).append(m.group(2))
    for m in ENUM.finditer(text):
        all_names = list(dict.fromkeys(names[m.group(1)]))
        if len(all_names) < 2 or text[:m.start()].endswith('case '):
            continue
        other = all_names[(all_names.index(m.group(2)) + 1) % len(all_names)]
        yield m.start(2), m.end(2), other, 'constant'


def statements(text):
    for m in STATEMENT.finditer(text):  # one within the other: `if (a) b;` and `b;`
        statement = m.group(1)
        if KEYWORD.match(statement) or DECLARATION.match(statement):
            continue
        if statement.count('(') != statement.count(')') or not re.search(r'[(=]|\+\+|--|^(?:break|continue)$', statement):
            continue  # a part of a for's head
        yield m.start(1), m.end(1), '', 'statement'
    for m in ROW.finditer(text):
        yield m.start(), m.end(), '', 'row'


def mutants(source):
    text = masked(source)
    lines = source.split('\n')
    found = []
    for maker in (operators, conditions, numbers, words, statements):
        for start, end, other, kind in maker(text):
            line = source.count('\n', 0, start + (len(text[start:end]) - len(text[start:end].lstrip()))) + 1
            was = ' '.join(source[start:end].split())
            # A removed statement keeps its lines, so that the others keep their numbers.
            kept = other + '\n' * (source.count('\n', start, end) - other.count('\n'))
            change = f'`{was}` → `{other}`' if other and was else f'`{was}` removed' if was else f'`{other}` added'
            if kind == 'condition':
                change = 'condition negated'
            found.append(Mutant(start, end, kept, kind, line, lines[line - 1].strip(), change))
    return sorted(found, key=lambda m: (m.start, m.end, m.text))
