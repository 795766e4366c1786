"""Regular expressions from strangers: the POSIX extended syntax, searched for in time proportional to pattern and text.

Python's own ``re`` tries one way after the other and can take longer than the age of the universe over ``(a+)+b``. Here all ways
are followed at once. Source: K. Thompson, Regular expression search algorithm, Communications of the ACM 11 (1968) 419.
"""

import string
from collections.abc import Callable
from dataclasses import dataclass, field

_LONGEST, _DEEPEST, _MOST_STATES, _MOST_TIMES = 256, 32, 1000, 255
_CLASSES = {
    "alpha": str.isalpha,
    "digit": str.isdigit,
    "alnum": str.isalnum,
    "upper": str.isupper,
    "lower": str.islower,
    "space": str.isspace,
    "blank": " \t".__contains__,
    "punct": string.punctuation.__contains__,
    "xdigit": string.hexdigits.__contains__,
    "print": str.isprintable,
    "graph": lambda letter: letter.isprintable() and not letter.isspace(),
    "cntrl": lambda letter: ord(letter) < 32 or ord(letter) == 127,
}
_Test = Callable[[str], bool]


class PatternError(ValueError):
    """A pattern that cannot be understood, or is too large."""


@dataclass
class _State:
    """Goes on to ``following``: past a letter that passes ``test``, else past none, at one ``edge`` of the text if it has one."""

    test: _Test | None = None
    edge: str = ""
    following: list["_State"] = field(default_factory=list)


_Builder = Callable[[_State], _State]  # given what follows a part of the pattern, where that part begins


class NamePattern:
    r"""A compiled pattern.

    Literals, ``.``, ``[...]`` with ranges and classes such as ``[:alpha:]``, ``( )``, ``|``, ``*``, ``+``, ``?``, ``{m,n}``,
    ``^``, ``$``, and ``\`` before a character that is meant as such. No references to groups, which POSIX has not either.

    Args:
        text: of the pattern.

    Raises:
        PatternError: if it cannot be understood, or is longer, deeper or larger than names can need.
    """

    def __init__(self, text: str):
        if len(text) > _LONGEST:
            raise PatternError(f"the pattern has {len(text)} characters, {_LONGEST} are allowed")
        self._text, self._at, self._depth, self._states = text, 0, 0, 0
        build = self._alternatives()
        if self._at < len(text):
            raise self._error("')' without '('")
        self._end = _State()
        self._begin = build(self._end)

    def found_in(self, text: str) -> bool:
        """Whether any part of a text matches."""
        now: dict[int, _State] = {}
        for at, letter in enumerate(text):
            self._reach(self._begin, now, at == 0, False)
            after: dict[int, _State] = {}
            for state in now.values():
                if state.test is not None and state.test(letter):
                    for following in state.following:
                        self._reach(following, after, False, at == len(text) - 1)
            if id(self._end) in now:
                return True
            now = after
        self._reach(self._begin, now, not text, True)
        return id(self._end) in now

    @staticmethod
    def _reach(state: _State, reached: dict[int, _State], first: bool, last: bool) -> None:
        """Add a state and all that it leads to without a letter."""
        left = [state]
        while left:
            state = left.pop()
            passable = {"": True, "^": first, "$": last}[state.edge]
            if id(state) not in reached and passable:
                reached[id(state)] = state
                if state.test is None:
                    left += state.following

    def _state(self, *following: _State, test: _Test | None = None, edge: str = "") -> _State:
        self._spend()
        return _State(test, edge, list(following))

    def _spend(self) -> None:
        self._states += 1
        if self._states > _MOST_STATES:
            raise PatternError("the pattern repeats too much")

    def _alternatives(self) -> _Builder:
        branches = [self._sequence()]
        while self._take("|"):
            branches.append(self._sequence())
        if len(branches) == 1:
            return branches[0]
        return lambda follow: self._state(*(branch(follow) for branch in branches))

    def _sequence(self) -> _Builder:
        parts = []
        while self._at < len(self._text) and self._text[self._at] not in "|)":
            parts.append(self._repeated())

        def build(follow: _State) -> _State:
            for part in reversed(parts):
                follow = part(follow)
            return follow

        return build

    def _repeated(self) -> _Builder:
        build = self._single()
        while self._at < len(self._text) and self._text[self._at] in "*+?{":
            build = self._times(build, *self._bounds())
        return build

    def _bounds(self) -> tuple[int, int | None]:
        sign = self._next()
        if sign != "{":
            return {"*": (0, None), "+": (1, None), "?": (0, 1)}[sign]
        inside = ""
        while (letter := self._next()) != "}":
            inside += letter
        low, comma, high = inside.partition(",")
        if not low.isdecimal() or (high and not high.isdecimal()) or max(len(low), len(high)) > 3:
            raise self._error("{ } must hold one or two whole numbers")
        bounds = int(low), (int(high) if high else None) if comma else int(low)
        if max(bounds[0], bounds[1] or 0) > _MOST_TIMES or (bounds[1] is not None and bounds[1] < bounds[0]):
            raise self._error(f"{{ }} must hold rising numbers up to {_MOST_TIMES}")
        return bounds

    def _times(self, build: _Builder, low: int, high: int | None) -> _Builder:
        def repeat(follow: _State) -> _State:
            if high is None:
                loop = self._state(follow)
                loop.following.insert(0, build(loop))
                follow = loop
            else:
                past = follow
                for _ in range(high - low):
                    follow = self._state(build(follow), past)
            for _ in range(low):
                self._spend()  # also where nothing is repeated
                follow = build(follow)
            return follow

        return repeat

    def _single(self) -> _Builder:
        letter = self._next()
        if letter == "(":
            return self._group()
        if letter in "^$":
            return lambda follow: self._state(follow, edge=letter)
        if letter in "*+?{":
            raise self._error(f"'{letter}' has nothing to repeat")
        if letter == "[":
            test = self._bracket()
        elif letter == ".":
            test = bool  # any letter
        else:
            test = self._escaped().__eq__ if letter == "\\" else letter.__eq__
        return lambda follow: self._state(follow, test=test)

    def _group(self) -> _Builder:
        self._depth += 1
        if self._depth > _DEEPEST:
            raise PatternError(f"the pattern has groups in groups more than {_DEEPEST} deep")
        build = self._alternatives()
        if not self._take(")"):
            raise self._error("'(' without ')'")
        self._depth -= 1
        return build

    def _escaped(self) -> str:
        letter = self._next()
        if letter.isalnum():
            raise self._error(f"'\\{letter}' is not POSIX extended syntax; use classes such as [[:digit:]]")
        return letter

    def _bracket(self) -> _Test:
        inverse, tests, first = self._take("^"), [], True
        while first or not self._take("]"):
            low, first = self._next(), False
            if low == "[" and self._take(":"):
                tests.append(self._named_class())
            elif self._text[self._at : self._at + 1] == "-" and self._text[self._at + 1 : self._at + 2] not in ("", "]"):
                self._at += 1
                high = self._next()
                tests.append(lambda letter, low=low, high=high: low <= letter <= high)
            else:
                tests.append(low.__eq__)
        return lambda letter: any(test(letter) for test in tests) is not inverse

    def _named_class(self) -> _Test:
        name, _, _ = self._text[self._at :].partition(":]")
        if name not in _CLASSES:
            raise self._error(f"unknown class; known are {', '.join(_CLASSES)}")
        self._at += len(name) + 2
        return _CLASSES[name]

    def _next(self) -> str:
        if self._at >= len(self._text):
            raise self._error("the end comes too early")
        self._at += 1
        return self._text[self._at - 1]

    def _take(self, letter: str) -> bool:
        found = self._text[self._at : self._at + 1] == letter
        self._at += found
        return found

    def _error(self, what: str) -> PatternError:
        return PatternError(f"at character {self._at} of the pattern: {what}")
