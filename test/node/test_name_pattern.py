"""Patterns from strangers: the same answers as Python's ``re`` gives, in a time that cannot run away."""

import re
import time

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sand_sim.node.name_pattern import NamePattern, PatternError

LETTERS = "ab_"
ATOMS = st.sampled_from(["a", "b", "_", ".", "[ab]", "[^a]", "[a-b_]", "^", "$"])
PATTERNS = st.recursive(
    ATOMS,
    lambda inner: st.one_of(
        st.tuples(inner, inner).map("".join),
        st.tuples(inner, inner).map(lambda pair: f"({pair[0]}|{pair[1]})"),
        st.tuples(inner, st.sampled_from(["*", "+", "?", "{2}", "{1,3}", "{0,1}", "{2,}"])).map(lambda p: f"({p[0]}){p[1]}"),
    ),
    max_leaves=8,
)


@settings(max_examples=1000, deadline=None)
@given(PATTERNS, st.text(LETTERS, max_size=7))
def test_same_answers_as_the_library(pattern, text):
    # The library's $ also stands before a line break at the end; there is none here.
    assert NamePattern(pattern).found_in(text) == bool(re.search(pattern, text))


@pytest.mark.parametrize(
    ("pattern", "text", "found"),
    [
        ("", "plate", True),
        ("", "", True),
        ("^$", "", True),
        ("^$", "x", False),
        ("^(plate|bucket)$", "bucket", True),
        ("^(plate|bucket)$", "buckets", False),
        ("[[:digit:]]{2}$", "stone_07", True),
        ("[[:alpha:]-]", "7-", True),
        ("[]x]", "]", True),
        ("[a-]", "-", True),
        (r"a\.b", "a.b", True),
        (r"a\.b", "axb", False),
        ("()", "a", True),
        ("a||b", "c", True),
    ],
)
def test_posix_syntax(pattern, text, found):
    assert NamePattern(pattern).found_in(text) is found


@pytest.mark.parametrize(
    ("pattern", "named"),
    [
        ("(", "too early|without"),
        (")", "without"),
        ("a)", "without"),
        ("*a", "nothing to repeat"),
        ("[a", "too early"),
        ("a{2", "too early"),
        ("a{x}", "whole numbers"),
        ("a{9999}", "whole numbers"),
        ("a{3,2}", "rising"),
        ("a\\", "too early"),
        (r"(a)\1", "POSIX"),
        ("[[:hex:]]", "unknown class"),
        ("(" * 200, "deep"),
        ("a" * 300, "300 characters"),
        ("((a{200}){200}){200}", "too much"),
        (16 * "(" + 16 * "){255}", "too much"),
        ("((((((a?){9}){9}){9}){9}){9}){9}", "too much"),
    ],
)
def test_refused_with_a_reason(pattern, named):
    with pytest.raises(PatternError, match=named):
        NamePattern(pattern)


@pytest.mark.parametrize(
    "pattern",
    [
        "a" + 250 * "*" + "b",
        30 * "(" + "a*" + 30 * ")*" + "b",
        "(a+)+b",
        "(a*)*b",
        "(a|a)*b",
        "(a|aa)+$b",
        "(.*)(.*)(.*)(.*)(.*)(.*)b",
        "(a?){64}a{64}b",
        "((a*)*)*b",
    ],
)
def test_what_never_ends_elsewhere_ends_here(pattern):
    begin = time.perf_counter()
    assert not NamePattern(pattern).found_in(200 * "a")
    assert time.perf_counter() - begin < 2.0
