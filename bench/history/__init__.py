"""Runs over time: what two of them differ in, and what many show of a machine that is measured again and again.

Uncertainty is carried into both: values of two runs share influences by identity, and what they share is no difference.
"""
