"""The C library opens a model that Python or OpenSSL signed, and nothing else where a signature is asked for."""

from __future__ import annotations

import ctypes
import ctypes.util
import hashlib
import shutil
import threading
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from endosdk.runtime.signatures import signed_model
from tests.c_library import binding as c
from tests.conftest import ROOT, TINY_MODEL, shifted_pair
from tests.runtime.test_signatures import new_key, openssl, sign

ed25519 = pytest.importorskip(
    "cryptography.hazmat.primitives.asymmetric.ed25519", reason="no cryptography: pip install 'endosdk[signed]'"
)
serialization = pytest.importorskip("cryptography.hazmat.primitives.serialization")
CRYPTO = ctypes.util.find_library("crypto")
if CRYPTO is None:
    pytest.skip("no libcrypto (Debian: apt-get install libssl3)", allow_module_level=True)

MODEL = TINY_MODEL.read_bytes()
OTHER_MODEL = ROOT / "models" / "fast-320.onnx"


@dataclass(frozen=True)
class Vendor:
    """Who signs models, with the raw public key that the C library takes."""

    private: Any

    @classmethod
    def new(cls) -> Vendor:
        return cls(ed25519.Ed25519PrivateKey.generate())

    @property
    def public_key(self) -> bytes:
        return self.private.public_key().public_bytes_raw()

    @property
    def pem(self) -> bytes:
        encoding, form = serialization.Encoding.PEM, serialization.PublicFormat.SubjectPublicKeyInfo
        return self.private.public_key().public_bytes(encoding, form)

    def options(self, model: bytes = MODEL) -> dict[str, Any]:
        return of_bytes(public_key=self.public_key, signature=self.private.sign(model))


def of_bytes(**values: bytes) -> dict[str, Any]:
    """Options that are bytes, each with its size."""
    return {**values, **{f"{name}_size": len(value) for name, value in values.items()}}


def refusal(library: ctypes.CDLL, model: Path | bytes, **options: Any) -> str:
    with pytest.raises(c.CError) as refused:
        c.CEstimator(library, model, **options)
    return f"{refused.value.name}: {refused.value}"


@pytest.fixture(scope="module")
def vendor() -> Vendor:
    return Vendor.new()


def test_one_signature_file_serves_both_languages(library, vendor, tmp_path):
    model = Path(shutil.copy(TINY_MODEL, tmp_path / "model.onnx"))
    (tmp_path / "public.pem").write_bytes(vendor.pem)
    signature = tmp_path / "model.onnx.sig"
    signature.write_bytes(vendor.private.sign(MODEL))
    options = of_bytes(public_key=vendor.public_key, signature=signature.read_bytes())
    for opened in (model, signed_model(model, tmp_path / "public.pem")):
        estimator = c.CEstimator(library, opened, **options)
        identity = estimator.predict(*shifted_pair(96, 160, 9), maps=("disparity",))[0].identity
        assert identity.model_sha256.decode() == hashlib.sha256(MODEL).hexdigest()
        estimator.close()


@pytest.mark.skipif(shutil.which("openssl") is None, reason="no openssl (Debian: apt-get install openssl)")
def test_the_commands_of_the_page_make_what_the_library_takes(library, tmp_path):
    model = Path(shutil.copy(TINY_MODEL, tmp_path / "model.onnx"))
    private, public = new_key(tmp_path, "vendor")
    sign(model, private)
    openssl("pkey", "-pubin", "-in", public, "-outform", "DER", "-out", tmp_path / "public.der")
    key = (tmp_path / "public.der").read_bytes()[-32:]
    signature = Path(f"{model}.sig").read_bytes()
    c.CEstimator(library, model, **of_bytes(public_key=key, signature=signature)).close()


def test_any_change_of_model_signature_or_key_is_refused(library, vendor, tmp_path):
    good = {"model": MODEL, "signature": vendor.private.sign(MODEL), "public_key": vendor.public_key}
    for name, content in good.items():
        for place in (0, len(content) // 2, len(content) - 1):
            spoilt = content[:place] + bytes([content[place] ^ 1]) + content[place + 1 :]
            parts = {**good, name: spoilt}
            (tmp_path / "model.onnx").write_bytes(parts["model"])
            options = of_bytes(public_key=parts["public_key"], signature=parts["signature"])
            for model in (parts["model"], tmp_path / "model.onnx"):
                said = refusal(library, model, **options)
                assert said.startswith("MODEL_HASH_MISMATCH: model: ")
                assert "valid Ed25519 signature by this key; got one of other bytes or by another key" in said


def test_what_is_no_key_or_no_signature_is_refused(library, vendor):
    key, signature = vendor.public_key, vendor.private.sign(MODEL)
    for wrong in (key[:-1], key + b"\0", vendor.pem):
        said = refusal(library, MODEL, **of_bytes(public_key=wrong, signature=signature))
        assert said.startswith("INVALID_ARGUMENT: public_key: must be the 32 bytes of an Ed25519 public key")
        assert f"got {len(wrong)} bytes" in said
    said = refusal(library, MODEL, **of_bytes(public_key=bytes(32), signature=signature))
    assert said.startswith("INVALID_ARGUMENT: public_key: must be a key") and "got zeros" in said
    for wrong in (signature[:-1], signature + b"\0"):
        said = refusal(library, MODEL, **of_bytes(public_key=key, signature=wrong))
        assert said.startswith("MODEL_HASH_MISMATCH") and f"got {len(wrong)} bytes of signature, not 64" in said
    assert "MODEL_HASH_MISMATCH" in (said := refusal(library, MODEL, **of_bytes(public_key=key))) and "got none" in said
    assert "INVALID_ARGUMENT: public_key: must be given" in refusal(library, MODEL, **of_bytes(signature=signature))
    assert "INVALID_ARGUMENT: public_key" in refusal(library, MODEL, public_key=key)
    assert "INVALID_ARGUMENT: signature" in refusal(library, MODEL, **of_bytes(public_key=key), signature_size=64)


def test_a_signature_needs_libcrypto_and_says_so(library, vendor):
    said = refusal(library, MODEL, **vendor.options(), crypto_library=b"/no/such/libcrypto.so.3")
    assert said.startswith("DEPENDENCY_MISSING: crypto_library: OpenSSL's libcrypto") and "/no/such/" in said
    said = refusal(library, MODEL, **vendor.options(), crypto_library=b"libm.so.6")
    assert said.startswith("DEPENDENCY_MISSING: crypto_library") and "libm.so.6, another library" in said
    assert "INVALID_ARGUMENT: crypto_library" in refusal(library, MODEL, **vendor.options(), crypto_library=b"")
    c.CEstimator(library, MODEL, **vendor.options(), crypto_library=CRYPTO.encode()).close()


def test_the_model_that_is_opened_instead_needs_a_signature_of_its_own(library, vendor):
    """It is checked before the provider, which is not here, is looked for."""
    instead = {"provider": b"webgpu", "float32_model": bytes(OTHER_MODEL)}
    assert "MODEL_HASH_MISMATCH" in refusal(library, MODEL, **vendor.options(), **instead)
    own = of_bytes(float32_model_signature=vendor.private.sign(OTHER_MODEL.read_bytes()))
    assert "PROVIDER_UNAVAILABLE" in refusal(library, MODEL, **vendor.options(), **instead, **own)


def test_a_file_that_is_exchanged_while_it_is_opened_gives_the_signed_bytes_or_nothing(library, vendor, tmp_path):
    """Whoever read it once to check and once to open would take the other model now and then."""
    model, signed = tmp_path / "model.onnx", hashlib.sha256(MODEL).hexdigest()
    over = threading.Event()

    def exchange() -> None:
        while not over.is_set():
            for source in (TINY_MODEL, OTHER_MODEL):
                (tmp_path / "next.onnx").symlink_to(source)
                (tmp_path / "next.onnx").replace(model)

    model.symlink_to(TINY_MODEL)
    exchanging = threading.Thread(target=exchange)
    exchanging.start()
    outcomes = set()
    try:
        for _ in range(100):
            try:
                estimator = c.CEstimator(library, model, threads=1, **vendor.options())
            except c.CError as refused:
                outcomes.add(refused.name)
                continue
            outcomes.add("opened")
            assert signed.encode() in estimator.diagnostics()
            estimator.close()
    finally:
        over.set()
        exchanging.join()
    assert outcomes == {"opened", "MODEL_HASH_MISMATCH"}


def test_a_refused_signature_leaves_no_error_to_the_host(library, vendor):
    """A host that uses OpenSSL, too, would take it for one of its own calls."""
    crypto = ctypes.CDLL(CRYPTO)
    crypto.ERR_peek_error.restype = ctypes.c_ulong
    crypto.ERR_clear_error()
    refusal(library, MODEL, **(vendor.options() | of_bytes(signature=bytes(64))))
    assert crypto.ERR_peek_error() == 0
