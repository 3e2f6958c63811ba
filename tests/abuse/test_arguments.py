"""Every argument of every public function, tried with every value that it is not meant for."""

from __future__ import annotations

import warnings

import pytest

from softreach.support.errors import SoftreachError
from tests.abuse.bad_values import BAD, without
from tests.abuse.public_calls import CALLS, UNTRIED, Call
from tests.abuse.refusals import within_memory
from tests.test_names import FUNCTIONS, parameters


def answer(name: str, call: Call, argument: str, value: object) -> str:
    """What is wrong with how softreach takes the value; nothing if it is refused in one line."""
    function = call.function or FUNCTIONS[name]
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            function(**{**call.good(), argument: value})
    except SoftreachError as error:
        text = str(error)
        if "\n" in text or len(text) > 600:
            return f"refused at length: {text}"
        named = argument in text or (call.said and call.said in text)
        return "" if named else f"not named: {text}"
    except Exception as error:
        return f"{type(error).__name__}: {error}"
    return "accepted"


@pytest.mark.parametrize("name", CALLS)
def test_an_argument_takes_what_it_is_meant_for_or_refuses_in_one_line(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)  # what is written when an argument is right goes nowhere else
    call = CALLS[name]
    with within_memory():
        answers = {
            f"{argument} = {what}": answer(name, call, argument, value)
            for argument, (kind, fine) in call.arguments(name).items()
            for what, value in without(BAD[kind], *fine).items()
        }
    assert {what: wrong for what, wrong in answers.items() if wrong} == {}


def test_every_public_function_is_tried():
    functions = {n for n, f in FUNCTIONS.items() if n.rpartition(".")[2] == f.__qualname__}
    asked = {n for n in functions if not n.startswith("errors.") and parameters(FUNCTIONS[n])}
    assert asked - set(UNTRIED) - set(CALLS) == set()
    assert set(CALLS) <= set(FUNCTIONS)
