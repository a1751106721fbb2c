"""Benchmarks for asv: main calls, the shipped study, the start of the command, peak memory.

CONTRIBUTING.md says how to run them and how to read the result.
"""
