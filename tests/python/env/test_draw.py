"""Random numbers of tasks: a generator's known answers, one number for one meaning, and their distribution."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

import tightloop as tl
from tightloop._core import draw

# Numbers of a sample, and standard errors that a mean may be off: one of 100 000 samples is further out
SAMPLE = 200_000
ERRORS = 4.5
# A number that is rounded to 1 in float32 when it is rounded to nearest: its seed, in episode 0 of stream 0, and column
NEARLY_ONE = (7_065_937, 1)

Words = NDArray[np.uint64]
MASK = np.uint64(0xFFFF_FFFF)
HALF = np.uint64(32)


def philox(counter: tuple[Words, ...], key: tuple[Words, ...]) -> list[Words]:
    """Philox4x32-10 (Salmon and others, SC 2011), written apart from the one that is tested; 32 bits in each array."""
    a, b, c, d = counter
    low, high = key
    for _ in range(10):
        p, q = a * np.uint64(0xD251_1F53), c * np.uint64(0xCD9E_8D57)
        a, b, c, d = (q >> HALF) ^ b ^ low, q & MASK, (p >> HALF) ^ d ^ high, p & MASK
        low, high = (low + np.uint64(0x9E37_79B9)) & MASK, (high + np.uint64(0xBB67_AE85)) & MASK
    return [a, b, c, d]


def reference(
    seeds: NDArray[np.uint64], episodes: NDArray[np.uint32], stream: int, columns: int
) -> NDArray[np.float64]:
    """The 53 highest of the first 64 bits, as a fraction."""
    world = np.zeros((len(seeds), columns), np.uint64)
    counter = (
        world,
        world + episodes[:, None].astype(np.uint64),
        world + np.uint64(64 + stream),
        world + np.arange(columns, dtype=np.uint64),
    )
    high, low, _, _ = philox(counter, ((world + seeds[:, None]) & MASK, (world + seeds[:, None]) >> HALF))
    return ((high << HALF | low) >> np.uint64(11)) / 2.0**53


def some(n: int) -> tuple[Words, NDArray[np.uint32]]:
    """Seeds and episodes all over their range."""
    pick = np.random.default_rng(1)
    return pick.integers(0, 2**64, n, np.uint64), pick.integers(0, 2**32, n, np.uint32)


def test_the_reference_gives_the_known_answers_of_random123():
    # kat_vectors of Random123 1.14, philox4x32 10
    for counter, key, expected in [
        ((0, 0, 0, 0), (0, 0), (0x6627_E8D5, 0xE169_C58D, 0xBC57_AC4C, 0x9B00_DBD8)),
        ((2**32 - 1,) * 4, (2**32 - 1,) * 2, (0x408F_276D, 0x41C8_3B0E, 0xA20B_C7C6, 0x6D54_51FD)),
        (
            (0x243F_6A88, 0x85A3_08D3, 0x1319_8A2E, 0x0370_7344),
            (0xA409_3822, 0x299F_31D0),
            (0xD16C_FE09, 0x94FD_CCEB, 0x5001_E420, 0x2412_6EA1),
        ),
    ]:
        words = philox(tuple(np.array([x], np.uint64) for x in counter), tuple(np.array([x], np.uint64) for x in key))
        assert [int(word[0]) for word in words] == list(expected)


@pytest.mark.parametrize("stream", [0, 1, 17, 31])
def test_numbers_are_those_of_the_reference_bit_for_bit(stream):
    seeds, episodes = some(1000)
    drawn = draw(seeds, episodes, stream, 9)
    assert drawn.dtype == np.float64
    assert np.array_equal(drawn, reference(seeds, episodes, stream, 9))


def test_single_precision_is_the_next_number_towards_zero():
    seeds, episodes = some(100_000)
    exact = draw(seeds, episodes, 3, 4)
    out = np.full(exact.shape, np.nan, np.float32)
    assert draw(seeds, episodes, 3, 4, out) is out
    assert (out <= exact).all() and (np.nextafter(out, np.float32(2)) > exact).all()
    seed, column = NEARLY_ONE
    one = np.array([seed], np.uint64), np.zeros(1, np.uint32), 0, column + 1
    single = np.zeros((1, column + 1), np.float32)
    assert np.float32(draw(*one)[0, column]) == 1.0, "this one shows the difference"
    assert draw(*one, single)[0, column] == np.nextafter(np.float32(1), np.float32(0))


def test_a_number_depends_on_seed_episode_stream_and_column_alone():
    seeds, episodes = some(64)
    every = draw(seeds, episodes, 2, 6)
    order = np.random.default_rng(2).permutation(64)
    assert np.array_equal(draw(seeds[order], episodes[order], 2, 6), every[order])
    for row in range(64):
        one = slice(row, row + 1)
        assert np.array_equal(draw(seeds[one], episodes[one], 2, 3), every[one, :3])
    # rows and columns with others between them
    seeds_apart, episodes_apart = np.repeat(seeds, 2)[::2], np.repeat(episodes, 3)[::3]
    wide = np.full((64, 10), -1.0, np.float32)
    draw(seeds_apart, episodes_apart, 2, 6, wide[:, 2:8])
    assert np.array_equal(wide[:, 2:8], draw(seeds, episodes, 2, 6, np.empty((64, 6), np.float32)))
    assert (wide[:, [0, 1, 8, 9]] == -1).all()
    assert draw(seeds[:0], episodes[:0], 2, 6).shape == (0, 6) and draw(seeds, episodes, 2, 0).shape == (64, 0)


def test_numbers_are_uniform_along_seeds_episodes_columns_and_streams():
    n = SAMPLE
    count, zeros = np.arange(n), np.zeros(n, np.uint32)
    samples = {
        "seeds": draw(count.astype(np.uint64), zeros, 0, 1)[:, 0],
        "episodes": draw(np.full(n, 7, np.uint64), count.astype(np.uint32), 0, 1)[:, 0],
        "columns": draw(np.array([7], np.uint64), np.zeros(1, np.uint32), 0, n)[0],
        "streams": np.concatenate([draw(np.array([7], np.uint64), zeros[:1], k, n // 32)[0] for k in range(32)]),
    }
    for along, sample in samples.items():
        assert (sample >= 0).all() and (sample < 1).all(), along
        for power in (1, 2, 3):
            # E x^p = 1 / (p + 1), its variance 1 / (2 p + 1) - 1 / (p + 1)²
            mean, variance = 1 / (power + 1), 1 / (2 * power + 1) - 1 / (power + 1) ** 2
            error = abs((sample**power).mean() - mean) / np.sqrt(variance / n)
            assert error < ERRORS, f"{along}: x^{power} is {error} errors off"
        # Kolmogorov and Smirnov's D √n is below 1.95 in 999 of 1000 samples
        steps = np.arange(1, n + 1) / n
        assert np.abs(np.sort(sample) - steps).max() * np.sqrt(n) < 1.95, along


def test_numbers_of_neighbours_are_uncorrelated():
    seeds, zeros = np.arange(SAMPLE, dtype=np.uint64), np.zeros(SAMPLE, np.uint32)
    own = draw(seeds, zeros, 4, 2)
    others = {
        "the next column": own[:, 1],
        "the next seed": draw(seeds + np.uint64(1), zeros, 4, 1)[:, 0],
        "the next episode": draw(seeds, zeros + np.uint32(1), 4, 1)[:, 0],
        "the next stream": draw(seeds, zeros, 5, 1)[:, 0],
    }
    for name, other in others.items():
        # the product of two deviations has variance 1/144
        error = abs(((own[:, 0] - 0.5) * (other - 0.5)).mean()) * 12 * np.sqrt(SAMPLE)
        assert error < ERRORS, f"{name}: correlation is {error} errors off"


def test_wrong_arguments_are_refused_by_name():
    seeds, episodes = some(4)
    for arguments, named in [
        ((seeds, episodes[:3], 0, 2), r"episodes has shape \(3,\) and seeds \(4,\)"),
        ((seeds, episodes, 32, 2), r"stream is 32; give one from 0 to 31"),
        ((seeds, episodes, -1, 2), r"stream is -1"),
        ((seeds, episodes, 0, 2**24 + 1), r"columns is 16777217"),
        ((seeds, episodes, 0, 2, np.zeros((4, 3))), r"out has shape \(4, 3\); expected \(4, 2\)"),
    ]:
        with pytest.raises(tl.ArgumentError, match=named):
            draw(*arguments)
    read_only = np.zeros((4, 2))
    read_only.flags.writeable = False
    for arguments, named in [
        ((seeds.astype(np.int64), episodes, 0, 2), "seeds"),
        ((seeds, episodes.astype(np.uint64), 0, 2), "episodes"),
        ((seeds, episodes, 0, 2, np.zeros((4, 2), int)), "float32 or float64"),
        ((seeds, episodes, 0, 2, np.zeros(8)), "two axes"),
        ((seeds, episodes, 0, 2, read_only), "not writeable"),
    ]:
        with pytest.raises(TypeError, match=named):
            draw(*arguments)
    assert not read_only.any()
