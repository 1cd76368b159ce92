"""What only people know of a run: laboratory, customer and authorisation, of the rig file or to be filled in by hand."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from reports import tables
from reports.counts import words
from reports.view import Fact

Content = Mapping[str, Any]
# Key in [laboratory] of the rig file, label, clause letter of ISO/IEC 17025, 7.8.2.1. What is not there is a line to fill in.
_ASKED = (
    ("name", "Laboratory"),  # b
    ("address", "Address"),  # b
    ("customer", "Customer and contact"),  # e
    ("item_condition", "Condition of the item"),  # g
    ("received", "Item received on"),  # h
    ("deviations", "Deviations from the method"),  # n
    ("external_results", "Results from external providers"),  # p
    ("issued", "Date of issue"),  # j
    ("authorised_by", "Authorised by (name, signature)"),  # o
)
# What is told only where it is there, after the key before it.
_TOLD = {
    "address": (("contact", "Contact"), ("place", "Place of the measurements"), ("accreditation", "Accreditation")),
    "customer": (("order", "Order"),),
}
_LAST = "issued"


def facts(rig: Content) -> tuple[Fact, ...]:
    """Laboratory and authorisation, of the content of a rig file of any schema."""
    stated, customer = dict(_table(rig, "laboratory")), _table(rig, "customer")
    known = {**stated, **_table(stated, "other")}
    known.pop("other", None)
    if customer:
        whole = [str(customer[key]) for key in ("name", "address", "contact") if customer.get(key)]
        known |= {"customer": ", ".join(whole), **{key: customer[key] for key in ("order",) if key in customer}}
    return tuple(_facts(known))


def _facts(known: Content) -> Iterator[Fact]:
    asked = {key for key, _ in _ASKED} | {key for told in _TOLD.values() for key, _ in told}
    for key, label in _ASKED:
        if key == _LAST:  # what is one's own stands before date and signature
            yield from (Fact(words(k), tables.inline(v)) for k, v in known.items() if k not in asked)
        yield Fact(label, str(known.get(key) or ""), blank=not known.get(key))
        yield from (Fact(title, str(known[k])) for k, title in _TOLD.get(key, ()) if known.get(k))


def _table(content: Content, key: str) -> Content:
    found = content.get(key)
    return found if isinstance(found, Mapping) else {}
