"""The rod under loads: equilibria, their stability, and how they yield."""
