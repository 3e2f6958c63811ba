# The filament of ActiveFilaments.jl with the tips of a design of softreach.
# Lengths in m, angles in rad, E in Pa, density in kg/m^3.
using ActiveFilaments

rings = [
    Ring(MechanicalProperties(1000000.0, 0.5), Geometry(0.0375, 0.0625), FiberArchitecture(0.3141592653589793)),  # sector
]
innerTube = InnerTube(MechanicalProperties(1000000.0, 0.5), Geometry(0.0, 0.0375))
filament = AFilament(rings; L = 1.0, phi2 = 0.0, ρvol = 999.9999999999999, innerTube = innerTube)

activation = [
    ActivationPiecewiseGamma(3, [-2.4, -2.0, -2.7], 0.5235987755982988, 0.0),
]
γBounds = [
    ([-2.4, -2.0, -2.7], [0.0, 0.0, 0.0]),
]
