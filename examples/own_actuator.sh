#!/usr/bin/env bash
# An actuator of one's own from the command line, and an atlas that is interrupted and goes on.
#     bash own_actuator.sh path/to/spine.toml path/to/magnets.py
set -euo pipefail
spine=${1:-spine.toml}
magnets=${2:-magnets.py}

softreach design "$spine" --import "$magnets"
softreach reach "$spine" --import "$magnets"

# Twelve designs. The first try is interrupted, as by Ctrl-C; the same command continues what is there.
sweep=(softreach atlas build spines.zarr --design "$spine" --import "$magnets" --n 5000
    --vary "magnets 1.distance_m=0.005:0.015:4" --vary "magnets 2.newtons_per_ampere=0.5:1.5:3")
timeout --signal INT 3 "${sweep[@]}" || echo "interrupted"
"${sweep[@]}"
softreach atlas best spines.zarr exact_volume --import "$magnets"
