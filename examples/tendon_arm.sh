#!/usr/bin/env bash
# My tendon arm: where can it go, and with how much in its hand? Run in a folder of your own:
#     bash tendon_arm.sh path/to/tendon_arm.toml
set -euo pipefail
arm=${1:-tendon_arm.toml}

softreach design "$arm"

# What it reaches: three slices, a page that turns in the browser, the surface for a printer in mm.
softreach reach "$arm" --out slices.png --out reachable.html --out reachable.stl --unit mm --overwrite

# A place below the ceiling, as one would say it.
softreach solve "$arm" --target 60mm,40mm,-270mm

# How much of its reach a heavier load would cost.
softreach payload "$arm" --payloads 0g,20g,50g --out payload.png --overwrite

# A cloud of 20,000 tips, colored by the pull of each tendon, and as a table in mm.
softreach cloud "$arm" --n 20000 --out cloud.zarr --overwrite
softreach show cloud.zarr --activation 6,0,2 --out cloud.png --overwrite
softreach export cloud.zarr cloud.csv --unit mm --overwrite
