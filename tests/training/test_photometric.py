"""The step that the pictures ask for, against arithmetic done slowly and against shifts that are known."""

import numpy as np
import pytest
import torch

from endosdk.training.networks import photometric
from endosdk.training.networks.photometric import brightness, likely_step, moments, step
from tests.reference import model_functions

HEIGHT, WIDTH = 64, 96


def waves(shift, seed=0):
    """Smooth coloured texture [1, 3, H, W], 0..255, moved to the left by ``shift`` px: exact, nothing is resampled."""
    rng = np.random.default_rng(seed)
    y, x = np.mgrid[0:HEIGHT, 0:WIDTH].astype(float)
    picture = np.zeros((3, HEIGHT, WIDTH))
    for _ in range(24):
        across, down = rng.uniform(-0.6, 0.6), rng.uniform(-0.5, 0.5)
        wave = np.cos(across * (x + shift) + down * y + rng.uniform(0, 6.3))
        picture += rng.uniform(2, 9, (3, 1, 1)) * wave
    return torch.from_numpy(picture + 128.0).float()[None]


def compare(left, right, disparity, window=3):
    """Step [H/4, W/4] on cells of 4 px, for a disparity that is the same everywhere."""
    guess = torch.full((1, 1, HEIGHT // 4, WIDTH // 4), float(disparity))
    return step(moments(brightness(left), brightness(right), guess, 4), window)


def inner(values):
    """Away from the border, where the other view has nothing to compare with."""
    return values[0, 0, 2:-2, 6:-3]


@pytest.mark.parametrize("lacking", [-0.75, -0.3, 0.0, 0.1, 0.5, 1.0])
@pytest.mark.parametrize("disparity", [7.0, 9.25])
def test_the_step_is_what_the_disparity_lacks(disparity, lacking):
    found = inner(compare(waves(0.0), waves(disparity), disparity - lacking).step)
    assert abs(found.mean().item() - lacking) < 0.03 + 0.1 * abs(lacking)
    assert (found - lacking).abs().quantile(0.95) < 0.06 + 0.25 * abs(lacking)


def test_brighter_cameras_do_not_move_the_step():
    left, right = waves(0.0), waves(8.0)
    plain, brighter = compare(left, right, 7.5), compare(left, right + 20.0, 7.5)
    torch.testing.assert_close(inner(plain.step), inner(brighter.step), atol=2e-3, rtol=0.0)
    torch.testing.assert_close(inner(plain.mismatch), inner(brighter.mismatch), atol=2e-2, rtol=0.0)


def test_no_texture_no_step():
    flat = torch.full((1, 3, HEIGHT, WIDTH), 90.0)
    noise = torch.randn(2, 1, 3, HEIGHT, WIDTH, generator=torch.Generator().manual_seed(0))
    quiet = compare(flat + 0.5 * noise[0], flat + 0.5 * noise[1], 5.0)
    textured = compare(waves(0.0), waves(5.0), 5.0)
    assert inner(quiet.step).abs().max() < 0.3
    assert inner(quiet.texture).max() < inner(textured.texture).min()


def test_views_that_do_not_show_the_same_are_a_mismatch():
    same, other = compare(waves(0.0), waves(6.0), 6.0), compare(waves(0.0), waves(6.0, seed=1), 6.0)
    assert inner(other.mismatch).min() > inner(same.mismatch).max()


@pytest.mark.parametrize("cell", [2, 4])
def test_moments_equal_slow_arithmetic(cell):
    rng = np.random.default_rng(1)
    left, right = (rng.uniform(0, 4, (6, 16)) for _ in range(2))  # rows already averaged in pairs
    disparity = rng.uniform(-1, 20, (3, 4))
    found = moments(*(torch.from_numpy(v)[None, None] for v in (left, right, disparity)), cell=cell)
    wanted = model_functions.moments(left, right, disparity, cell)
    np.testing.assert_allclose(found[0].numpy(), wanted, atol=1e-12)


def means(*values):
    """Make the means [1, 5, 3, 3] of a grid on which each is the same everywhere."""
    return torch.tensor(values).view(1, 5, 1, 1).expand(1, 5, 3, 3)


def test_the_step_is_bounded_and_damped():
    assert step(means(0.0, 0.0, -1e6, 1.0, 1.0), 1).step.max() == photometric.LARGEST_STEP
    damped = step(means(0.0, 0.0, -0.1 * photometric.DAMPING, photometric.DAMPING, 1.0), 1).step
    torch.testing.assert_close(damped, torch.full((1, 1, 3, 3), 0.05))


def likely(left, right, disparity):
    """Likely step [H/8, W/8] on cells of 8 px, for a disparity that is the same everywhere, away from the border."""
    guess = torch.full((1, 1, HEIGHT // 8, WIDTH // 8), float(disparity))
    return likely_step(moments(brightness(left), brightness(right), guess, 8))[0, 0, 1:-1, 3:-2]


@pytest.mark.parametrize("lacking", [-0.4, -0.1, 0.0, 0.2, 0.45])
def test_the_likely_step_is_what_the_disparity_lacks(lacking):
    found = likely(waves(0.0), waves(9.0), 9.0 - lacking)
    assert (found - lacking).abs().max() < 0.03 + 0.15 * abs(lacking)


def test_of_views_that_say_little_no_step_is_likely():
    clear = likely(waves(0.0), waves(9.0), 8.7)
    other = likely(waves(0.0), waves(9.0, seed=1), 8.7)
    noise = torch.randn(2, 1, 3, HEIGHT, WIDTH, generator=torch.Generator().manual_seed(0))
    faint = [90.0 + 0.02 * (view - 128.0) + noise[i] for i, view in enumerate((waves(0.0), waves(9.0)))]
    assert clear.mean() > 0.27
    assert other.abs().mean() < 0.2
    assert likely(*faint, 8.7).abs().max() < 0.1


def test_the_likely_step_equals_slow_arithmetic():
    rng = np.random.default_rng(2)
    values = rng.uniform(-1, 1, (5, 4, 6))
    values[3:] = values[:2] ** 2 + rng.uniform(0, 1, (2, 4, 6))  # squares whose variances are not negative
    solved, shared = np.zeros((2, 4, 6))
    for y in range(4):
        for x in range(6):
            slope, difference, product, slope_square, difference_square = values[:, y, x]
            covariance = slope * difference - product
            noise = difference_square - difference**2 + photometric.QUIET
            texture = slope_square - slope**2
            solved[y, x] = covariance / (texture + photometric.DOUBT * noise)
            shared[y, x] = texture / (texture + noise)
    solved = np.pad(solved.clip(-photometric.LIKELY_STEP, photometric.LIKELY_STEP), 1, mode="edge")
    shared = np.pad(shared, 1, mode="edge")
    wanted = np.zeros((4, 6))
    for y in range(4):
        for x in range(6):
            around = (slice(y, y + 3), slice(x, x + 3))
            wanted[y, x] = np.average(solved[around], weights=shared[around] * np.outer([1, 2, 1], [1, 2, 1]))
    assert np.abs(solved).max() == photometric.LIKELY_STEP and np.abs(solved).min() < 0.1
    np.testing.assert_allclose(likely_step(torch.from_numpy(values)[None])[0, 0].numpy(), wanted, atol=1e-12)
