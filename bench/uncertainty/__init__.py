"""Values with their elementary influences: linear propagation by identity (GUM), Monte Carlo where that is not enough.

GUM is JCGM 100:2008; JCGM 101:2008 is its supplement on Monte Carlo.
"""

from bench.uncertainty.budgets import BudgetRow, budget, power_out, round_to_uncertainty, rounded_at, stated
from bench.uncertainty.coverage import PROBABILITY, Interval, coverage_factor, interval, welch_satterthwaite
from bench.uncertainty.estimate import Distribution, Estimate, Influence, correlation, correlation_matrix
from bench.uncertainty.propagation import propagate, propagate_stacked
from bench.uncertainty.series import SeriesMean, batch_means

__all__ = [
    "PROBABILITY",
    "BudgetRow",
    "Distribution",
    "Estimate",
    "Influence",
    "Interval",
    "SeriesMean",
    "batch_means",
    "budget",
    "correlation",
    "correlation_matrix",
    "coverage_factor",
    "interval",
    "power_out",
    "propagate",
    "propagate_stacked",
    "round_to_uncertainty",
    "rounded_at",
    "stated",
    "welch_satterthwaite",
]
