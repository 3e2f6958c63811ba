"""How near models in MuJoCo come to rest to the tips of softreach: the table of docs/models.md.

It takes half an hour on two cores; numbers of bodies as arguments take less.
"""

import sys

import numpy as np
from tests.made_models import HANGING, at_rest, model_arms, samples

import softreach as sr
from softreach.models import mujoco

TIPS = 20


def largest_distance(arm: sr.Manipulator, bodies: int) -> float:
    """Of tips at random activations, in L."""
    gamma = samples(arm, TIPS)
    tips = at_rest(mujoco(arm, bodies=bodies, damping=10.0), gamma)
    off = np.linalg.norm(tips - sr.tip_positions(arm, gamma), axis=1)
    return float(off.max()) / arm.length


def main(counts: list[int]) -> None:
    heads = " | ".join(map(str, counts))
    print(f"| arm | weight | {heads} |\n|---|---|{'--:|' * len(counts)}")
    for name, arm in model_arms().items():
        for weight, loads in (("no", {}), ("yes", HANGING)):
            errors = (largest_distance(arm.replace(**loads), count) for count in counts)
            print(f"| {name} | {weight} | {' | '.join(f'{e:.5f}' for e in errors)} |", flush=True)


if __name__ == "__main__":
    main([int(count) for count in sys.argv[1:]] or [25, 50, 100])
