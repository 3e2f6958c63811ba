"""Every argument of every public function, tried with every value that it is not meant for."""

from __future__ import annotations

import warnings
from contextlib import suppress

import pytest

from softreach.support.errors import SoftreachError
from tests.abuse.bad_values import BAD, without
from tests.abuse.public_calls import CALLS, UNTRIED, Call
from tests.abuse.refusals import within_budget
from tests.test_names import FUNCTIONS, parameters

TRIED = [
    pytest.param(call, argument, id=f"{name}({argument})")
    for name, call in CALLS.items()
    for argument in call.asked
]


def answer(call: Call, argument: str, value: object) -> str:
    """What is wrong with how softreach takes the value; nothing if it is refused in one line."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            call.function(**{**call.good(), argument: value})
    except SoftreachError as error:
        text = str(error)
        return "" if "\n" not in text and len(text) < 600 else f"refused at length: {text}"
    except Exception as error:
        return f"{type(error).__name__}: {error}"
    return "accepted"


@pytest.fixture(autouse=True)
def _elsewhere(tmp_path, monkeypatch):
    """What is written when an argument is as it should be goes nowhere else."""
    monkeypatch.chdir(tmp_path)


@pytest.mark.parametrize(("call", "argument"), TRIED)
def test_an_argument_takes_what_it_is_meant_for_or_refuses_in_one_line(call, argument):
    kind, fine = call.asked[argument]
    with suppress(Exception):
        call.function(**call.good())  # what is compiled and imported once is not counted
    with within_budget():
        answers = {
            name: answer(call, argument, value) for name, value in without(BAD[kind], *fine).items()
        }
    assert {name: found for name, found in answers.items() if found} == {}


def test_every_public_function_is_tried_with_each_of_its_arguments():
    functions = {n: f for n, f in FUNCTIONS.items() if n.rpartition(".")[2] == f.__qualname__}
    asked = {
        name: set(parameters(function))
        for name, function in functions.items()
        if not name.startswith("errors.") and name not in UNTRIED
    }
    assert {
        n: args - set(CALLS[n].asked if n in CALLS else ()) for n, args in asked.items() if args
    } == {name: set() for name, args in asked.items() if args}
