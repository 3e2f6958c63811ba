"""Independent answers, in NumPy and SciPy alone, that the library is held to.

`sections`: stiffness and actuator loads by quadrature. `tendon_rod`, `tendon_law`: tendons as
follower loads, and the linear law's distance from them. `rod`: a rod and its loads, for
`loaded_rod`, shooting from the base, and `chain`, energy and stability. `elastica`, `column`,
`bend`: closed forms and published values. `sorosim`: equilibria by another program, and
`linear_strains` the way it made them.
"""
