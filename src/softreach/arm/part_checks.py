"""Whether the parts of an arm are what they should be, fit each other, and can be told apart."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

from softreach.arm.actuator_checks import MOST_BUNDLES
from softreach.arm.actuators import Actuator
from softreach.arm.checks import name_faults
from softreach.arm.loads import Loads
from softreach.arm.profile import Profile
from softreach.arm.section import Section
from softreach.support.errors import Fault

if TYPE_CHECKING:
    from softreach.arm.manipulator import Manipulator

__all__ = ["fit_faults", "kind_faults", "named", "part_faults", "shared_names"]


def part_faults(arm: Manipulator) -> Iterator[Fault]:
    """Parts of the wrong type."""
    if not isinstance(arm.profile, Profile):
        yield Fault("profile", arm.profile, "must be a Profile, such as LinearTaper")
    if not isinstance(arm.section, Section):
        yield Fault("section", arm.section, "must be a Section")
    if not isinstance(arm.loads, Loads | None):
        yield Fault("loads", arm.loads, "must be Loads or None")
    yield from kind_faults(arm.actuators)


def kind_faults(actuators: Any) -> Iterator[Fault]:
    """What is no sequence of actuators."""
    if not isinstance(actuators, Sequence) or isinstance(actuators, str):
        yield Fault("actuators", actuators, "must be a sequence of actuators")
        return
    wrong = [k for k, part in enumerate(actuators) if not isinstance(part, Actuator)]
    for k in wrong:
        allowed = "must be an actuator, such as FiberArchitecture"
        yield Fault(f"actuators[{k}]", actuators[k], allowed)
    if not wrong and (count := sum(part.bundles for part in actuators)) > MOST_BUNDLES:
        yield Fault("actuators", f"{count} bundles", f"must be at most {MOST_BUNDLES} in all")


def fit_faults(arm: Manipulator) -> Iterator[Fault]:
    """What keeps actuators and loads from acting on this profile and section."""
    if arm.loads is not None:
        yield from arm.loads.section_faults(arm.section, arm.length)
    for actuator in arm.actuators:
        faults = actuator.section_faults(arm.profile, arm.section)
        yield from (
            fault
            if fault.path.startswith(("rings", "core"))
            else fault._replace(path=f"{actuator.name}.{fault.path}")
            for fault in faults
        )


def named(actuators: Sequence[Actuator]) -> Iterator[Actuator]:
    """The actuators, those without a name called "fiber 1", "fiber 2", ... by their places."""
    taken = {actuator.name for actuator in actuators}
    for place, actuator in enumerate(actuators, start=1):
        if actuator.name:
            yield actuator
            continue
        names = (f"{actuator.default_name} {number}" for number in itertools.count(place))
        name = next(name for name in names if name not in taken)
        taken.add(name)
        yield actuator.replace(name=name)


def shared_names(arm: Manipulator) -> Iterator[Fault]:
    """Names that two actuators or two bundles share."""
    yield from (faults := list(name_faults([one.name for one in arm.actuators], "actuators")))
    names = arm.bundle_names
    if not faults and len(set(names)) < len(names):
        twice = next(name for name in names if names.count(name) > 1)
        yield Fault("actuators", twice, "names two bundles: rename an actuator")
