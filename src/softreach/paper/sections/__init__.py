"""Sections of the report: each computes its numbers and judges the statements about them."""
