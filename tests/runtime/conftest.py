import pytest

from tests.conftest import shifted_pair
from tests.runtime.plane import HEIGHT, SHIFT, WIDTH


@pytest.fixture(scope="module")
def pair():
    return shifted_pair(HEIGHT, WIDTH, SHIFT)
