"""Models that are signed by Ed25519: the signature is checked of the very bytes that are then opened.

Needs the extra ``endosdk[signed]``. Sign where the key is kept, not on the device:

    openssl pkeyutl -sign -rawin -inkey private.pem -in model.onnx -out model.onnx.sig
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from endosdk.errors import DependencyMissing, InvalidArgument, ModelHashMismatch, ModelNotFound
from endosdk.io.bounded_read import Refused, read_bounded
from endosdk.io.extras import must_install
from endosdk.runtime.models import LARGEST_MODEL

LARGEST_SMALL_FILE = 65536  # bytes, of a key or a signature
RULE = "must have a valid Ed25519 signature by this key"


def signed_model(path: str | Path, public_key: str | Path, signature: str | Path | None = None) -> bytes:
    """Return the bytes of a model file whose signature holds, for `DepthEstimator`.

    ``public_key`` is a PEM file, ``signature`` the 64 bytes that OpenSSL writes; by default a file beside the model
    with ``.sig`` behind its name. Raises ModelHashMismatch where the signature is missing, of other bytes or by another
    key.
    """
    path = Path(path)
    try:
        data = read_bounded(path, LARGEST_MODEL)
    except Refused as refused:
        raise ModelNotFound("model", f"{path} {refused.rule}", refused.value) from refused
    beside = path.with_name(f"{path.name}.sig") if signature is None else Path(signature)
    try:
        signed = read_bounded(beside, LARGEST_SMALL_FILE)
    except Refused as refused:
        raise ModelHashMismatch("model", f"{path} {RULE}: {beside} {refused.rule}", refused.value) from refused
    key, invalid = _key(Path(public_key))
    try:
        key.verify(signed, data)
    except invalid as error:
        raise ModelHashMismatch("model", f"{path} {RULE}", f"{beside}, of other bytes or by another key") from error
    return data


def _key(path: Path) -> tuple[Any, type[Exception]]:
    """Return the public key, and what it raises where a signature does not hold."""
    try:
        from cryptography.exceptions import InvalidSignature, UnsupportedAlgorithm
        from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PublicKey
        from cryptography.hazmat.primitives.serialization import load_pem_public_key
    except ImportError as error:
        raise DependencyMissing("cryptography", must_install("signed"), "nothing") from error
    rule = "must be a PEM file of an Ed25519 public key"
    try:
        key = load_pem_public_key(read_bounded(path, LARGEST_SMALL_FILE))
    except (Refused, ValueError, UnsupportedAlgorithm) as error:  # no PEM, or a key of no known kind
        raise InvalidArgument("public_key", rule, f"{path}: {error}") from error
    if not isinstance(key, Ed25519PublicKey):
        raise InvalidArgument("public_key", rule, f"{path}: {type(key).__name__}")
    return key, InvalidSignature
