"""Finds small faults that scripts/mutate.py can put into C++ sources. Sources are formatted by clang-format, whose spaces
distinguish operators from template brackets and pointers."""
import dataclasses
import hashlib
import re

KINDS = ("operator", "constant", "dropped statement", "swapped arguments", "negated condition")


@dataclasses.dataclass(frozen=True)
class Fault:
    """A replacement of text[begin:end] of a file."""
    file: str
    kind: str
    begin: int
    end: int
    replacement: str
    line: int
    change: str  # "before -> after", shortened

    def applied(self, text):
        return text[:self.begin] + self.replacement + text[self.end:]


TOKEN = re.compile(r"""
    (?P<skip>//[^\n]*|/\*.*?\*/|^[ \t]*\#(?:[^\n]*\\\n)*[^\n]*|R"(?P<raw>[^(\s]*)\(.*?\)(?P=raw)"|"(?:\\.|[^"\\\n])*"|'(?:\\.|[^'\\\n])+')
  | (?P<number>(?<![\w.])(?:0[xX][0-9a-fA-F']+|\d[\d']*(?:\.\d*)?(?:[eE][-+]?\d+)?|\.\d+(?:[eE][-+]?\d+)?)[fFuUlLzZ]*)
  | (?P<word>[A-Za-z_]\w*)
  | (?P<operator><=>|<<=|>>=|->\*|\.\.\.|[-+*/%&|^]=|<<|>>|<=|>=|==|!=|&&|\|\||\+\+|--|->|::|[-+*/%&|^<>=!~?:;,.(){}\[\]])
""", re.VERBOSE | re.DOTALL | re.MULTILINE)

OPERATORS = {"+": "-", "-": "+", "*": "/", "/": "*", "+=": "-=", "-=": "+=", "*=": "/=", "/=": "*=", "<": "<=", "<=": "<",
             ">": ">=", ">=": ">", "==": "!=", "!=": "==", "&&": "||", "||": "&&"}
# Output and messages, and declarations that are not statements of a function.
TALK = re.compile(r"\b(fmt|printf|fprintf|cerr|cout|throw|\w*Error|warn\w*|complain\w*|static_assert|assert|pragma|message|describe\w*)\b")
NO_CALL = {"return", "if", "for", "while", "switch", "catch", "sizeof", "alignof", "decltype", "static_cast", "else", "case",
           "using", "operator", "noexcept", "throw", "delete", "new", "do", "template", "requires", "alignas", "goto"}


@dataclasses.dataclass
class Token:
    kind: str
    text: str
    begin: int
    end: int


def tokens_of(text):
    """The tokens of code, without comments, strings, characters and preprocessor lines."""
    found = []
    for match in TOKEN.finditer(text):
        if match.lastgroup == "raw" or match.group("skip"):
            if match.group(0)[:1] in "\"'R":
                found.append(Token("string", match.group(0), match.start(), match.end()))
            continue
        found.append(Token(match.lastgroup, match.group(0), match.start(), match.end()))
    return found


def matching(tokens):
    """The index of each bracket's partner."""
    partner, open_ = {}, []
    for i, t in enumerate(tokens):
        if t.text in ("(", "[", "{"):
            open_.append(i)
        elif t.text in (")", "]", "}") and open_:
            o = open_.pop()
            partner[o], partner[i] = i, o
    return partner


def in_functions(tokens, partner):
    """For each token, true if it is in the body of a function (including initialisers in braces)."""
    inside = [False] * len(tokens)
    for i, t in enumerate(tokens):
        if t.text != "{" or i not in partner:
            continue
        before = i - 1
        while before >= 0 and (tokens[before].text in ("const", "noexcept", "override", "final", "mutable")):
            before -= 1
        if before >= 0 and tokens[before].text == ")":
            for k in range(i + 1, partner[i]):
                inside[k] = True
    return inside


def statements(tokens, partner, inside):
    """Statements of functions that end with a semicolon: pairs of the first token's index and the semicolon's."""
    found = []
    for i, t in enumerate(tokens):
        starts = i > 0 and tokens[i - 1].text in (";", "{", "}") or i > 0 and tokens[i - 1].text == "else"
        if not starts and i > 0 and tokens[i - 1].text == ")" and (i - 1) in partner:
            head = partner[i - 1] - 1  # if (...) statement;
            starts = head >= 0 and tokens[head].text in ("if", "for", "while", "constexpr")
        if not starts or not inside[i]:
            continue
        k = i
        while k < len(tokens) and tokens[k].text != ";":
            if tokens[k].text in ("(", "[", "{") and k in partner:
                k = partner[k]
            elif tokens[k].text in (")", "]", "}"):
                break
            k += 1
        if k < len(tokens) and tokens[k].text == ";":
            found.append((i, k))
    return found


def is_declaration_or_jump(tokens, partner, i, end):
    """True for a declaration: two names in a row, or a type with * or & before a name, formatted as `T* x`."""
    if tokens[i].kind != "word" and tokens[i].text not in ("*", "++", "--", "("):
        return True
    if tokens[i].text in NO_CALL or tokens[i].text in ("break", "continue", "const", "auto", "static", "constexpr"):
        return True
    depth_free, k = [], i
    while k < end:
        depth_free.append(tokens[k])
        k = partner[k] + 1 if tokens[k].text in ("(", "[", "{") and k in partner else k + 1
    for a, b in zip(depth_free, depth_free[1:]):
        if a.text in ("=", "+=", "-="):
            break
        if b.kind == "word" and (a.kind == "word" or a.text in (">", "*", "&", "&&")) and a.end < b.begin and a is not depth_free[0]:
            return True
        if a is depth_free[0] and b.kind == "word" and a.kind == "word":
            return True
        if a is depth_free[0] and b.text in ("*", "&", "&&", "<") and b.begin == a.end:
            return True
    return not any(t.text in ("(", "=", "+=", "-=", "*=", "/=", "|=", "&=", "++", "--") for t in depth_free)


def shortened(text, most=60):
    one_line = " ".join(text.split())
    return one_line if len(one_line) <= most else one_line[:most - 3] + "..."


class Finder:
    def __init__(self, file, text):
        self.file, self.text = file, text
        self.tokens = tokens_of(text)
        self.partner = matching(self.tokens)
        self.inside = in_functions(self.tokens, self.partner)
        self.talks = self.talk()
        self.faults = []

    def talk(self):
        """The tokens of statements that print or throw messages."""
        talks, first = [False] * len(self.tokens), 0
        for i, t in enumerate(self.tokens):
            if t.text in (";", "{", "}"):
                if TALK.search(self.text[self.tokens[first].begin:t.end]):
                    for k in range(first, i + 1):
                        talks[k] = True
                first = i + 1
        return talks

    def add(self, kind, first, last, replacement):
        begin, end = self.tokens[first].begin, self.tokens[last].end
        before = self.text[begin:end]
        line = self.text.count("\n", 0, begin) + 1
        if kind in ("operator", "constant"):  # the place on its line tells more than the token
            start = self.text.rfind("\n", 0, begin) + 1
            stop = self.text.find("\n", end)
            whole = self.text[start:stop if stop >= 0 else len(self.text)]
            around = whole[:begin - start] + f"[{before} -> {replacement}]" + whole[end - start:]
            change = shortened(around, 110)
        else:
            change = f"{shortened(before)} -> {shortened(replacement) if replacement != ';' else 'nothing'}"
        self.faults.append(Fault(self.file, kind, begin, end, replacement, line, change))

    def operators_and_constants(self):
        for i, t in enumerate(self.tokens):
            if not self.inside[i] or self.talks[i]:
                continue
            spaced = self.text[t.begin - 1:t.begin] in (" ", "\n") and self.text[t.end:t.end + 1] in (" ", "\n")
            if t.kind == "operator" and t.text in OPERATORS and spaced:
                self.add("operator", i, i, OPERATORS[t.text])
            elif t.kind == "number" and not (i and self.tokens[i - 1].text in ("<", "[") and self.text[t.begin - 1] in "<["):
                digits = re.match(r"[\d.eE+-]+", t.text.replace("'", "")).group(0)
                if t.text[:2] in ("0x", "0X"):
                    continue
                if re.fullmatch(r"\d+", digits):
                    self.add("constant", i, i, str(int(digits) + 1) + t.text.replace("'", "")[len(digits):])
                else:
                    self.add("constant", i, i, t.text + " * 2" if float(digits) else "1.0")

    def dropped_statements(self):
        for i, end in statements(self.tokens, self.partner, self.inside):
            if not self.talks[i] and not is_declaration_or_jump(self.tokens, self.partner, i, end):
                self.add("dropped statement", i, end, ";")

    def swapped_arguments(self):
        for i, t in enumerate(self.tokens[:-1]):
            if t.kind != "word" or t.text in NO_CALL or self.tokens[i + 1].text != "(" or not self.inside[i] or self.talks[i]:
                continue
            close = self.partner.get(i + 1)
            if close is None:
                continue
            commas, k = [], i + 2
            while k < close:
                if self.tokens[k].text in ("(", "[", "{") and k in self.partner:
                    k = self.partner[k]
                elif self.tokens[k].text == ",":
                    commas.append(k)
                k += 1
            if not commas:
                continue
            second_end = (commas[1] if len(commas) > 1 else close) - 1
            a = self.text[self.tokens[i + 2].begin:self.tokens[commas[0] - 1].end]
            b = self.text[self.tokens[commas[0] + 1].begin:self.tokens[second_end].end]
            if a != b and not re.search(r"[\[{<]|\"", a + b):  # a lambda, a list, a template
                self.add("swapped arguments", i + 2, second_end, f"{b}, {a}")

    def negated_conditions(self):
        for i, t in enumerate(self.tokens[:-1]):
            if t.text not in ("if", "while") or self.tokens[i + 1].text != "(" or not self.inside[i] or self.talks[i]:
                continue
            close = self.partner.get(i + 1)
            if close is None or any(self.tokens[k].text in ("=", ";") for k in range(i + 2, close)):
                continue
            self.add("negated condition", i + 2, close - 1, f"!({self.text[self.tokens[i + 2].begin:self.tokens[close - 1].end]})")


def faults_in(file, text):
    """All faults of a source, in its order."""
    finder = Finder(file, text)
    finder.operators_and_constants()
    finder.dropped_statements()
    finder.swapped_arguments()
    finder.negated_conditions()
    return sorted(finder.faults, key=lambda f: (f.begin, f.kind))


def lot(seed, fault, number):
    """A fault's random rank. It depends on the fault alone, so that changes elsewhere do not change the selection."""
    return hashlib.sha256("\0".join([str(seed), fault.file, fault.kind, fault.change, str(number)]).encode()).digest()


def chosen(sources, seed):
    """The faults of these sources (name: text) in the order of trial: kinds in turn, places at random."""
    by_kind = {kind: [] for kind in KINDS}
    for file in sorted(sources):
        alike = {}
        for fault in faults_in(file, sources[file]):
            number = alike[fault.kind, fault.change] = alike.get((fault.kind, fault.change), -1) + 1
            by_kind[fault.kind].append((lot(seed, fault, number), fault))
    for faults in by_kind.values():
        faults.sort(key=lambda f: f[0], reverse=True)
    order = []
    while any(by_kind.values()):
        for kind in KINDS:
            if by_kind[kind]:
                order.append(by_kind[kind].pop()[1])
    return order
