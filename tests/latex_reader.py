"""Read the little LaTeX in which the errata print equations: sums, products without a sign, fractions, powers, roots."""

import re

import sympy as sp

TOKEN = re.compile(r"\\[A-Za-z]+|\d+(?:\.\d+)?|[A-Za-z]|[{}()\[\]+\-^_*,]")
SLOPE = re.compile(r"\\frac\{(?:d|\\partial )(\\?[A-Za-z]+(?:_\{\w+\})?)\}\{(?:d|\\partial )(?:t|i_\{od\})\}")
OPEN, CLOSE = {"(": ")", "[": "]", "{": "}"}, set(")]}")


def sides(latex):
    """Return what stands between the equal signs."""
    return latex.split("=")


def read(latex, symbols):
    """Return the SymPy expression of one side; ``symbols`` maps names such as ``i_{od}``, ``\\phi_{Rd}^*`` or ``d:I_{Sd}``."""
    names = {f"\\SLOPE{chr(97 + n)}": f"d:{name}" for n, name in enumerate(dict.fromkeys(SLOPE.findall(latex)))}
    for short, name in names.items():
        latex = SLOPE.sub(lambda match, short=short, name=name: short if f"d:{match[1]}" == name else match[0], latex)
    tokens = TOKEN.findall(latex.replace(r"\left", "").replace(r"\right", ""))
    reader = _Reader(tokens, names, symbols)
    result = reader.sum()
    assert reader.at == len(tokens), f"not read to its end: {latex} at {tokens[reader.at :]}"
    return result


class _Reader:
    def __init__(self, tokens, names, symbols):
        self.tokens, self.names, self.symbols, self.at = tokens, names, symbols, 0

    def next(self):
        return self.tokens[self.at] if self.at < len(self.tokens) else None

    def take(self):
        self.at += 1
        return self.tokens[self.at - 1]

    def sum(self):
        sign = -1 if self.next() == "-" else 1
        if self.next() in ("-", "+"):
            self.take()
        total = sign * self.product()
        while self.next() in ("+", "-"):
            total += (1 if self.take() == "+" else -1) * self.product()
        return total

    def product(self):
        total = self.power()
        while self.next() is not None and self.next() not in CLOSE | {"+", "-", ","}:
            total *= self.power()
        return total

    def power(self):
        base = self.atom()
        if self.next() == "^":
            self.take()
            base **= self.group()
        return base

    def group(self):
        close = OPEN[self.take()]
        inside = self.sum()
        assert self.take() == close
        return inside

    def text(self):
        assert self.take() == "{"
        found = ""
        while self.next() != "}":
            found += self.take()
        self.take()
        return found

    def atom(self):
        token = self.next()
        if token in OPEN:
            return self.group()
        self.take()
        if token[0].isdigit():
            return sp.Rational(token)
        if token == r"\frac":
            above = self.group()
            return above / self.group()
        if token in (r"\sqrt", r"\arctan"):
            return {r"\sqrt": sp.sqrt, r"\arctan": sp.atan}[token](self.group())
        name = self.names.get(token, token)
        if self.next() == "_":
            self.take()
            name += "_{" + self.text() + "}"
        if self.tokens[self.at : self.at + 4] == ["^", "{", "*", "}"]:
            self.at += 4
            name += "^*"
        return self.symbols[name]
