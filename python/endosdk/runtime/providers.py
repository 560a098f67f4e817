"""Names and options of execution providers, checked before a session is made."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from endosdk import _core
from endosdk.errors import InvalidArgument, ProviderUnavailable


def provider_name(provider: str) -> str:
    """Return the runtime's own name of a provider; both kinds of name are taken, in capitals or not."""
    if not isinstance(provider, str):
        raise InvalidArgument("provider", "must be the name of a provider", repr(provider))
    return _core.full_provider_name(provider)


def installed_provider(provider: str, runtime: Any) -> str:
    """Return the runtime's own name of a provider. Raises ProviderUnavailable where this runtime does not have it."""
    name, available = provider_name(provider), runtime.get_available_providers()
    if name not in available:
        names, installed = ", ".join(_core.providers), ", ".join(available)
        rule = f"must be a part of the onnxruntime that is here (installed: {installed}; short names: {names})"
        raise ProviderUnavailable("provider", rule, name)
    return name


def checked_options(provider: str, options: Mapping[str, str | int] | None) -> dict[str, str]:
    """Return the options of a provider as texts; numbers are written out, and floats not rounded unless asked for."""
    name, options = provider_name(provider), {} if options is None else options
    if not isinstance(options, Mapping):
        raise InvalidArgument("provider_options", "must map keys to texts", type(options).__name__)
    for key, value in options.items():
        if not isinstance(key, str) or not isinstance(value, str | int):
            raise InvalidArgument("provider_options", "must map texts to texts or whole numbers", f"{key!r}: {value!r}")
    return dict(_core.checked_provider_options(name, [(key, str(value)) for key, value in options.items()]))
