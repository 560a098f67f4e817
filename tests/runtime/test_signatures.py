"""Signed models: OpenSSL's own signature is taken, and nothing else is."""

import base64
import shutil
import subprocess
from pathlib import Path

import pytest

from endosdk import DepthEstimator, errors
from endosdk.runtime.signatures import signed_model
from tests.conftest import TINY_MODEL, shifted_pair

pytest.importorskip("cryptography", reason="no cryptography: pip install 'endosdk[signed]'")
if shutil.which("openssl") is None:
    pytest.skip("no openssl (Debian: apt-get install openssl)", allow_module_level=True)


def openssl(*arguments: object) -> None:
    subprocess.run(["openssl", *map(str, arguments)], check=True, capture_output=True)


def new_key(folder: Path, name: str, kind: str = "ed25519") -> tuple[Path, Path]:
    private, public = folder / f"{name}.pem", folder / f"{name}-public.pem"
    openssl("genpkey", "-algorithm", kind, "-out", private)
    openssl("pkey", "-in", private, "-pubout", "-out", public)
    return private, public


def sign(model: Path, private: Path) -> None:
    openssl("pkeyutl", "-sign", "-rawin", "-inkey", private, "-in", model, "-out", f"{model}.sig")


@pytest.fixture
def signed(tmp_path):
    model = Path(shutil.copy(TINY_MODEL, tmp_path / "model.onnx"))
    private, public = new_key(tmp_path, "vendor")
    sign(model, private)
    return model, public


def test_a_signed_model_is_opened_from_the_bytes_that_were_checked(signed):
    data = signed_model(*signed)
    assert data == TINY_MODEL.read_bytes()
    assert DepthEstimator(data).predict(*shifted_pair(96, 160, 9)).identity.model_sha256


def test_any_change_of_model_or_signature_is_refused(signed):
    model, public = signed
    for file in (model, model.with_name("model.onnx.sig")):
        good = file.read_bytes()
        for place in {0, len(good) // 2, len(good) - 1}:
            spoilt = bytearray(good)
            spoilt[place] ^= 1
            file.write_bytes(spoilt)
            with pytest.raises(errors.ModelHashMismatch, match="valid Ed25519 signature"):
                signed_model(model, public)
        for cut in (b"", good[:-1], good + b"\0"):
            file.write_bytes(cut)
            with pytest.raises(errors.ModelHashMismatch, match="valid Ed25519 signature"):
                signed_model(model, public)
        file.write_bytes(good)
    signed_model(model, public)


def test_another_key_and_no_signature_are_refused(signed, tmp_path):
    model, _ = signed
    with pytest.raises(errors.ModelHashMismatch, match="by another key"):
        signed_model(model, new_key(tmp_path, "stranger")[1])
    Path(f"{model}.sig").unlink()
    with pytest.raises(errors.ModelHashMismatch, match="no such file"):
        signed_model(*signed)
    with pytest.raises(errors.ModelNotFound):
        signed_model(tmp_path / "none.onnx", signed[1])


def test_what_is_no_ed25519_key_is_refused(signed, tmp_path):
    model, _ = signed
    (tmp_path / "text.pem").write_text("no key")
    # A public key of the type 1.2.3.4.5, which is not known yet.
    content = b"\x30\x0e" + b"\x30\x06\x06\x04\x2a\x03\x04\x05" + b"\x03\x04\x00\x01\x02\x03"
    text = base64.b64encode(content).decode()
    (tmp_path / "new.pem").write_text(f"-----BEGIN PUBLIC KEY-----\n{text}\n-----END PUBLIC KEY-----\n")
    no_keys = [tmp_path / f"{name}.pem" for name in ("text", "none", "new")]
    for file in (*no_keys, new_key(tmp_path, "other", "x25519")[1]):
        with pytest.raises(errors.InvalidArgument, match="Ed25519 public key"):
            signed_model(model, file)
