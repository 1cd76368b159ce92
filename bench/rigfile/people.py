"""Who measured, for whom: what a certificate by ISO/IEC 17025, 7.8.2.1 and 7.8.4.1 needs and no instrument tells."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated

from pydantic import Field

from bench.rigfile.part import Part

Text = Annotated[str, Field(pattern=r"\S")]


class Laboratory(Part):
    """Who is responsible. Of 7.8.2.1: `name`, `address` (b), `place` where it was measured, if that is another (c), `contact`,
    `accreditation`: its number and by whom; `item_condition` (g), `received` (h), `issued` (j), `deviations` from the
    method (n), `authorised_by` (o), `external_results` (p). `customer` is for who has no table [customer]. `other` are
    lines of one's own, label to text."""

    name: Text | None = None
    address: Text | None = None
    place: Text | None = None
    contact: Text | None = None
    accreditation: Text | None = None
    customer: Text | None = None
    item_condition: Text | None = None
    received: Text | None = None
    deviations: Text | None = None
    external_results: Text | None = None
    issued: Text | None = None
    authorised_by: Text | None = None
    other: Mapping[str, Text] = {}


class Customer(Part):
    """For whom it is measured, 7.8.2.1 e; `order` is their own number of it."""

    name: Text
    address: Text | None = None
    contact: Text | None = None
    order: Text | None = None


def typed_laboratory(stated: Mapping[str, object]) -> dict[str, object]:
    """The table of schema 1, which had any keys: those that are typed now, and `other` with all that are texts."""
    known = {key: value for key, value in stated.items() if key in Laboratory.model_fields}
    others = {key: value for key, value in stated.items() if key not in Laboratory.model_fields}
    return {**known, **({"other": others} if others else {})}
