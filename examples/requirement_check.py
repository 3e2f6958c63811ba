"""Does my arm meet what it is for? Five places, each with 20 g in its hand and at most 6 N of pull.

Run it as `python requirement_check.py path/to/tendon_arm.toml`.
"""

import sys

import softreach as sr

PLACES_MM = [[0, 0, -298], [30, 20, -285], [-30, 20, -285], [0, -60, -275], [60, 40, -270]]
TOLERANCE_MM = 1.0
STRONGEST_PULL = 6.0  # N
PAYLOAD = 0.02  # kg

arm = sr.Manipulator.load(sys.argv[1] if len(sys.argv) > 1 else "tendon_arm.toml")
arm = arm.replace(loads=sr.Loads(payload=PAYLOAD)).with_bounds((0.0, STRONGEST_PULL))
solutions = sr.solve_inverse(arm, [[1e-3 * x for x in place] for place in PLACES_MM])

for place, solution in zip(PLACES_MM, solutions, strict=True):
    if len(solution):
        verdict = f"reached, with {', '.join(f'{pull:.2f}' for pull in solution.activations[0])} N"
    elif 1e3 * solution.gap <= TOLERANCE_MM:
        verdict = f"reached to {1e3 * solution.gap:.2f} mm"
    else:
        verdict = f"missed by {1e3 * solution.gap:.1f} mm"
    print(f"{place!s:>18} mm: {verdict}")

curve = sr.payload_curve(arm, [0.0, PAYLOAD])
print(f"{100 * curve.shares[-1]:.0f} % of the reach without a load are left with 20 g")
