"""What a procedure is made of, and what it is handed."""

from bench.plan import BenchPlan
from bench.procedure.origin import Origin
from bench.procedure.procedure import Procedure, read_method
from bench.quantity import Measured, Quantity

__all__ = ["BenchPlan", "Measured", "Origin", "Procedure", "Quantity", "read_method"]
