"""Loaded rods: equilibria of many activations at a time, by shooting from the tip."""
