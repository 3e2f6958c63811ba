"""An arm as the text of an MJCF model, which MuJoCo simulates: a chain of bodies with springs."""

from __future__ import annotations

import xml.etree.ElementTree as ET

import numpy as np

from softreach.arm.actuators import Actuator, Tendon
from softreach.arm.body import mass
from softreach.arm.loads import Loads
from softreach.arm.manipulator import Manipulator, a_manipulator
from softreach.arm.section import turned
from softreach.arm.tables import ends_over
from softreach.models.chain import MOST_BODIES, Chain, bodies_for, chain_of, check_simulated
from softreach.support.arguments import as_integer, as_number
from softreach.support.arrays import Array
from softreach.support.errors import Range

_TOLERANCES = Range(1e-6, 0.1)
_DAMPINGS = Range(0.0, 10.0, unit="s", open_low=True)
_AXES = np.eye(3)
_HELD = 1e6  # stiffness of what stands for an activation, over that of the arm
_DIGITS = 6  # of dη/dγ, in which elements that grow alike agree


def mujoco(
    arm: Manipulator, *, bodies: int | None = None, tol: float = 1e-3, damping: float = 0.05
) -> str:
    """The arm as an MJCF model for MuJoCo 3.7 or newer: a chain of bodies.

    Neighbors are joined by a slide and three hinges, whose springs are the stiffness of the
    sections between them. Tendons run through sites and pull along their bent lines; the forces and
    moments of all other bundles are linear in the control. Controls are the activations of the
    bundles, in their order, unit, names and bounds. Sites are the tip, named `tip`, and the
    markers. Bodies of the arm touch others and not each other.

    The matter of fibers and muscles grows with the activation, theory (86), and turns more where it
    is longer: springs between the hinges and a hidden slide do the same, to 0.2 % of the turn
    where no more than two fifths of the length are lost.

    Args:
        arm: The design. It has Young's moduli and densities, and neither drives, guides, tendons
            driven by length nor forces beside gravity and payload.
        bodies: Bodies of the chain, up to a few more where parts of the arm begin or end; None for
            as many as `tol` needs by an estimate.
        tol: Largest tip error at rest, in L, by an estimate; it decides the number of bodies.
        damping: Viscosity over stiffness of the arm [s].

    Returns:
        The text of the model.

    Raises:
        InvalidDesign: A modulus or a density is missing, or an activation within the bounds would
            shorten the arm to nothing.
        InvalidInput: An argument is out of its range.
        NotPossible: The arm has what no such model has; the sentence names it.
    """
    arm = a_manipulator("arm", arm)
    tol, damping = as_number("tol", tol, _TOLERANCES), as_number("damping", damping, _DAMPINGS)
    if bodies is not None:
        bodies = as_integer("bodies", bodies, 2, MOST_BODIES)
    check_simulated(arm, "a model of MuJoCo")
    chain = chain_of(arm, bodies or bodies_for(arm, tol))
    return _Model(arm, chain, damping).text()


class _Model:
    """The document of a model, in which elements come from base to tip."""

    def __init__(self, arm: Manipulator, chain: Chain, damping: float) -> None:
        self.arm, self.chain, self.damping = arm, chain, damping
        self.loads = arm.loads or Loads(gravity=(0.0, 0.0, 0.0))
        self.root = root = ET.Element("mujoco", model="softreach")
        _add(root, "compiler", angle="radian", autolimits="true", inertiafromgeom="false")
        gravity = self.loads.gravity
        _add(root, "option", timestep=0.002, integrator="implicitfast", gravity=gravity)
        look = {"contype": 0, "conaffinity": 1, "rgba": (0.8, 0.6, 0.5, 1.0)}
        _add(_add(root, "default"), "geom", type="cylinder", **look)
        axes, position = arm.base.rotation.T[:2], arm.base.position
        world = _add(root, "worldbody")
        self.bodies = [_add(world, "body", name="base", pos=position, xyaxes=axes)]  # to the tip
        self.tendons, self.actuators = _add(root, "tendon"), _add(root, "actuator")

    def text(self) -> str:
        self._growth()
        self._chain()
        self._sites()
        pairs = zip(self.arm.bundle_names, self.arm.bundle_actuators, strict=True)
        for k, (name, actuator) in enumerate(pairs):
            self._bundle(k, name, actuator)
        self._growth_springs()
        ET.indent(self.root, " ")
        return ET.tostring(self.root, encoding="unicode") + "\n"

    def _growth(self) -> None:
        """A hidden slide for all elements that grow alike, at x = 1 - 1/η.

        Bundles pull at it with the force e = η - 1 = x/(1 - x), times its stiffness; springs that
        join it to hinges with x θ² leave each 1/η of its stiffness.
        """
        rates, kinds = np.unique(self.chain.growth.round(_DIGITS), axis=0, return_inverse=True)
        self.held = _HELD / self.chain.compliance.sum(axis=0).max()
        self.growth = {int(k): rates[k] for k in np.flatnonzero(rates.any(axis=1))}
        self.kinds = kinds.ravel()
        for k, rate in self.growth.items():
            same, ends = self.kinds == k, ends_over(rate[None], self.arm.bounds)[0]
            terms = self.held * _spring_of_growth(*ends)
            terms[1] += 0.5 * _inverse(self.chain.compliance[same]).sum()  # what those springs add
            hidden = _add(self.bodies[0], "body", name=f"growth {k + 1}", gravcomp=1)
            _inertial(hidden, 1e-3 * mass(self.arm), np.zeros(3), np.zeros(3))
            spring = {"stiffness": terms, "damping": self.damping * terms[0]}
            _add(hidden, "joint", name=f"growth {k + 1}", type="slide", axis=_AXES[2], **spring)

    def _chain(self) -> None:
        """A body a node, with its element's mass, and the tip, with half of the last element."""
        chain, count = self.chain, len(self.chain.masses)
        lengths, radii = np.diff(chain.edges), self.arm.profile.radius(chain.nodes)
        turning = self.arm.section.gyration_at(self.arm.profile, chain.nodes)
        for k, gap in enumerate(np.diff(chain.nodes, prepend=0.0, append=self.arm.length)):
            name, last = f"body {k + 1}" if k < count else "tip", min(k, count - 1)
            body = _add(self.bodies[-1], "body", name=name, pos=(0.0, 0.0, gap))
            share = 1.0 if k < count - 1 else 0.5
            length, own = share * lengths[last], share * chain.masses[last]
            center = 0.5 * (share - 1.0) * lengths[last] * _AXES[2]
            across = own * (turning[last] + length**2 / 12.0)
            _inertial(body, own, center, np.array([across, across, 2.0 * own * turning[last]]))
            self._joint(body, f"slide {k + 1}", "slide", _AXES[2], chain.axial_compliance[k])
            if k < count:
                self._hinges(body, k)
                _add(body, "geom", size=(radii[k], 0.5 * lengths[k]))
            self.bodies.append(body)
        if self.loads.payload:
            point = _add(self.bodies[-1], "body", name="payload", pos=self.loads.payload_arm)
            _inertial(point, self.loads.payload, np.zeros(3), np.zeros(3))

    def _hinges(self, body: ET.Element, k: int) -> None:
        """Those of an element; their order alternates, so that what it costs cancels."""
        axes = turned(_AXES, self.arm.section.bending_angle).T
        for axis in range(3) if k % 2 == 0 else range(2, -1, -1):
            spring = self.chain.compliance[k, axis], self.chain.rest_turns[k, axis]
            self._joint(body, _hinge(k, axis), "hinge", axes[axis], *spring)

    def _joint(
        self,
        body: ET.Element,
        name: str,
        kind: str,
        axis: Array,
        compliance: float,
        rest: float = 0.0,
    ) -> None:
        """A joint with its spring; none where the arm is rigid."""
        if compliance > 0.0:
            spring = {"stiffness": 1.0 / compliance, "damping": self.damping / compliance}
            _add(body, "joint", name=name, type=kind, axis=axis, springref=rest, **spring)

    def _place(self, z: float) -> tuple[ET.Element, float]:
        """The body that a section goes with, and how far beyond its origin it is [m]."""
        if z >= self.arm.length:
            return self.bodies[-1], 0.0
        k = int(np.searchsorted(self.chain.nodes, z, side="right"))
        if z == self.chain.nodes[k - 1] and k % 2 == 0:
            k -= 1  # every other node: what leads from one to the next then bends evenly
        return self.bodies[k], z - (0.0 if k == 0 else self.chain.nodes[k - 1])

    def _site(self, name: str, z: float, point: Array) -> None:
        body, beyond = self._place(z)
        _add(body, "site", name=name, pos=np.asarray(point) + beyond * _AXES[2], size=1e-3)

    def _sites(self) -> None:
        names = [marker.name for marker in self.arm.markers]
        tip = "tip"
        while tip in names:
            tip = f"{tip} of the arm"
        self._site(tip, self.arm.length, np.zeros(3))
        for marker in self.arm.markers:
            z = marker.station_at("station", self.arm.length)
            self._site(marker.name, z, np.array(marker.offset))

    def _bundle(self, k: int, name: str, actuator: Actuator) -> None:
        """The tendon of a bundle, along lines of the arm or over its joints, and its actuator."""
        low, high = self.arm.bounds[k]
        bounds = {"ctrlrange": (low, high)} if low < high else {}
        if not isinstance(actuator, Tendon):
            self._add_moments(k, name)
            _add(self.actuators, "general", name=name, tendon=name, **bounds)
            return
        (start, end), nodes = actuator.span(self.arm.length), self.chain.nodes
        stations = np.array([start, *nodes[(nodes > start) & (nodes < end)], end])
        column = actuator.bundle_names.index(name)
        points = actuator.points_at(self.arm.profile, stations)[..., column]
        line = _add(self.tendons, "spatial", name=name, width=5e-4)
        for i, (z, point) in enumerate(zip(stations, points, strict=True)):
            self._site(f"{name}@{i}", z, point)
            _add(line, "site", site=f"{name}@{i}")
        _add(self.actuators, "general", name=name, tendon=name, gear=-1.0, **bounds)

    def _add_moments(self, k: int, name: str) -> None:
        """The force and the moments of a bundle on all joints, per control."""
        chain = self.chain
        line = _add(self.tendons, "fixed", name=name)
        for i, compliance in enumerate(chain.axial_compliance):
            if compliance > 0.0:
                _couple(line, f"slide {i + 1}", chain.stretch[i, k] / compliance)
        for (i, axis), compliance in np.ndenumerate(chain.compliance):
            if compliance > 0.0:
                _couple(line, _hinge(i, axis), chain.turns[i, axis, k] / compliance)
        for kind, rate in self.growth.items():
            if rate[k]:
                _couple(line, f"growth {kind + 1}", self.held * rate[k])

    def _growth_springs(self) -> None:
        """Springs of -x θ²/2 times the stiffness of hinges: (x + θ)³ + (x - θ)³ = 2x³ + 6xθ²."""
        for k, kind in enumerate(self.kinds):
            if kind not in self.growth:
                continue
            for axis in np.flatnonzero(self.chain.compliance[k]).tolist():
                hinge, term = _hinge(k, axis), -0.25 / self.chain.compliance[k, axis]
                for sign in (1.0, -1.0):
                    name, terms = f"{hinge} {sign:+g}", (0.0, term, 0.0)
                    line = _add(self.tendons, "fixed", name=name, springlength=0.0, stiffness=terms)
                    _couple(line, f"growth {kind + 1}", 1.0)
                    _couple(line, hinge, sign)


def _spring_of_growth(low: float, high: float) -> Array:
    """a, b and c of e = a x + b x² + c x³ at x = e/(1 + e), for e from low to high or 0."""
    e = np.linspace(min(low, 0.0), max(high, 0.0), 65)
    x = e / (1.0 + e)
    terms = np.linalg.lstsq(np.stack([x, x**2, x**3], axis=1), e)[0]
    return np.asarray(terms, float)


def _inverse(compliance: Array) -> Array:
    """Stiffness by compliance, 0 where rigid."""
    return np.divide(1.0, compliance, out=np.zeros_like(compliance), where=compliance > 0.0)


def _hinge(k: int, axis: int) -> str:
    return f"hinge {k + 1} {'xyz'[axis]}"


def _couple(line: ET.Element, joint: str, coefficient: float) -> None:
    _add(line, "joint", joint=joint, coef=coefficient)


def _inertial(body: ET.Element, own: float, place: Array, moments: Array) -> None:
    _add(body, "inertial", pos=place, mass=own, diaginertia=np.maximum(moments, 1e-14))


def _add(parent: ET.Element, tag: str, **attributes: object) -> ET.Element:
    """A new element whose numbers are written with twelve digits."""
    return ET.SubElement(parent, tag, {name: _written(x) for name, x in attributes.items()})


def _written(value: object) -> str:
    if isinstance(value, str):
        return value
    return " ".join(f"{number:.12g}" for number in np.ravel(np.asarray(value, float)) + 0.0)
