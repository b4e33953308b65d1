# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The callback of a service from a function that returns the fields of its response; recorder and replay use it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any


def answering(answer: Callable[[Any], Mapping[str, Any] | None]) -> Callable[[Any, Any], Any]:
    """Return the callback of a service.

    Parameters
    ----------
    answer : callable
        Takes the request and returns the fields of the response by name, or None for a response without fields.
    """

    def serve(request: Any, response: Any) -> Any:
        for name, value in (answer(request) or {}).items():
            setattr(response, name, value)
        return response

    return serve
