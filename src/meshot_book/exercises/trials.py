"""Exercises of chapters 25 to 28, studies and trials: truths, cases, and the usual mistakes with their hints."""

import functools
import itertools
import math
from collections.abc import Callable

import numpy as np
import scipy.integrate
import scipy.stats
import torch
from scipy import stats

from meshot.types import Array, Float, Tensor
from meshot_book.exercises.verdict import Exercise, exercise
from meshot_book.statistics import people_needed

# Chapter 25: the reliability of pairs, the size of a group, visits or people.


_MOST_VISITS = 500


@exercise(stars=1)
def pair_reliability() -> Exercise:
    """Check ``function(first, second)``: the intraclass correlation of two visits of the same people."""

    def squares(first: Float[Array, " n"], second: Float[Array, " n"]) -> tuple[float, float]:
        return float(np.var(first + second, ddof=1) / 2), float(np.mean((first - second) ** 2) / 2)

    def ratio(between: float, within: float, minus: float = 1.0) -> float:
        return (between - minus * within) / (between + within)

    generator = np.random.default_rng(0)
    people = generator.normal(size=(40, 1))
    pairs = people + 0.5 * generator.normal(size=(40, 2))
    cases = {
        "forty people": (pairs[:, 0], pairs[:, 1]),
        "a second visit that is larger by 1": (pairs[:12, 0], pairs[:12, 0] + 1.0),
        "visits without a relation": (pairs[:7, 0], pairs[20:27, 1]),
        "three people": (pairs[:3, 0], pairs[:3, 1]),
    }
    mistakes = {
        "Pearson's correlation does not see a shift between the visits; the intraclass correlation does": (
            lambda a, b: np.corrcoef(a, b)[0, 1]
        ),
        "the mean square between people contains the error too: subtract the mean square within people above": (
            lambda a, b: ratio(*squares(a, b), minus=0.0)
        ),
        "the mean square between people is twice the variance of the people's means, and the one within people is half "
        "the mean of the squared differences": (
            # Half the square between people, or twice the one within people: the ratio is the same.
            lambda a, b: ratio(squares(a, b)[0], 2 * squares(a, b)[1])
        ),
        "divide the squares between people by the number of people less one": (
            lambda a, b: ratio(squares(a, b)[0] * (len(a) - 1) / len(a), squares(a, b)[1])
        ),
        "do not subtract the mean difference: a shift between the visits is an error too": (
            lambda a, b: ratio(squares(a, b)[0], np.var(a - b, ddof=1) / 2)
        ),
    }
    return Exercise(lambda a, b: ratio(*squares(a, b)), cases, mistakes)


@exercise(stars=2)
def group_size() -> Exercise:
    """Check ``function(effect, reliability, power)``: people in each of two groups, by the normal approximation."""

    def people(effect: float, reliability: float, power: float, level: float = 0.975) -> float:
        return 2 * (stats.norm.ppf(level) + stats.norm.ppf(power)) ** 2 / (effect**2 * reliability)

    cases = {
        "a perfect measurement": (0.5, 1.0, 0.8),
        "a reliability of 0.6": (0.5, 0.6, 0.8),
        "a power of 0.95": (1.2, 0.9, 0.95),
        "a small effect": (0.13, 0.45, 0.9),
    }
    mistakes = {
        "the reliability is not used": lambda d, r, p: math.ceil(people(d, 1.0, p)),
        "a lower reliability must need more people, not fewer": lambda d, r, p: math.ceil(people(d, 1 / r, p)),
        "the effect that is seen is √ρ times the true one, so its square is ρ times": (
            lambda d, r, p: math.ceil(people(d, r**2, p))
        ),
        "the effect is squared in the formula, so the reliability stands there without a root": (
            lambda d, r, p: math.ceil(people(d, r**0.5, p))
        ),
        "a difference of two means has twice the variance of one mean": lambda d, r, p: math.ceil(people(d, r, p) / 2),
        "a two-sided test at 5 % has 2.5 % on each side": lambda d, r, p: math.ceil(people(d, r, p, level=0.95)),
        "the power is not used": lambda d, r, p: math.ceil(people(d, r, 0.5)),
        "rounded down, the power is too small: round up": lambda d, r, p: math.floor(people(d, r, p)),
        "people are whole: round up": people,
        "that is the exact number, by the non-central t; here the normal approximation is asked for": people_needed,
    }
    return Exercise(lambda d, r, p: math.ceil(people(d, r, p)), cases, mistakes)


@exercise(stars=3)
def best_visits() -> Exercise:
    """Check ``function(reliability, person_cost, visit_cost)``: visits of a person at the lowest cost."""

    def best(reliability: float, person_cost: float, visit_cost: float) -> int:
        return cheapest(lambda k: (person_cost + k * visit_cost) * more_people(reliability, k))

    def more_people(reliability: float, n_visits: int) -> float:
        """One over the reliability of the mean of the visits, by Spearman and Brown."""
        return (1 + (n_visits - 1) * reliability) / (n_visits * reliability)

    def cheapest(cost: Callable[[int], float]) -> int:
        return min(range(1, _MOST_VISITS), key=cost)

    def turning_point(reliability: float, person_cost: float, visit_cost: float) -> float:
        return math.sqrt(person_cost * (1 - reliability) / (visit_cost * reliability))

    cases = {
        "a reliable measurement": (0.95, 100.0, 100.0),
        "a person who is hard to find": (0.6, 1000.0, 200.0),
        "an unreliable measurement": (0.2, 300.0, 100.0),
        "a cheap visit": (0.5, 1000.0, 9.0),
        "a minimum between one and two": (0.5, 210.0, 100.0),
        "a visit that costs more than finding a person": (0.1, 100.0, 300.0),
        "a minimum just above one": (0.5, 130.0, 100.0),
    }
    mistakes = {
        "a person costs something too: a second visit can be cheaper than another person": lambda r, person, visit: 1,
        "the cost is not symmetric around its minimum: compare the two whole numbers beside it": (
            lambda r, person, visit: max(1, round(turning_point(r, person, visit)))
        ),
        "compare the two whole numbers beside the minimum; the smaller one may be cheaper": (
            lambda r, person, visit: max(1, math.ceil(turning_point(r, person, visit)))
        ),
        "compare the two whole numbers beside the minimum; the larger one may be cheaper": (
            lambda r, person, visit: max(1, math.floor(turning_point(r, person, visit)))
        ),
        "a more reliable measurement needs fewer visits, not more: ρ is the share between people": (
            lambda r, person, visit: best(1 - r, person, visit)
        ),
        "the two costs are exchanged": (
            lambda r, person, visit: cheapest(lambda k: (visit + k * person) * more_people(r, k))
        ),
        "a person has a whole number of visits: compare the two whole numbers beside it": turning_point,
    }
    return Exercise(best, cases, mistakes)


# Chapter 26: systems in the same order, who is better by an interval, and the best motion between two surfaces.


@exercise(stars=1)
def same_order() -> Exercise:
    """Check ``function(printed, ours)``: the share of all pairs of systems that both tables put in the same order."""

    def agree(printed: list[float], ours: list[float], one: int, other: int) -> bool:
        return (printed[one] - printed[other]) * (ours[one] - ours[other]) > 0

    def same(printed: list[float], ours: list[float]) -> float:
        pairs = itertools.combinations(range(len(printed)), 2)
        return float(np.mean([agree(printed, ours, *pair) for pair in pairs]))

    printed = [0.390, 0.346, 0.271, 0.234, 0.202]
    cases = {
        "five systems in the same order": (printed, [0.61, 0.52, 0.5, 0.3, 0.2]),
        "the best system of five last": (printed, [0.5, 0.45, 0.4, 0.3, 0.6]),
        "two neighbours exchanged": (printed, [0.5, 0.45, 0.35, 0.4, 0.3]),
        "two systems": (printed[:2], [0.2, 0.4]),
    }
    mistakes = {
        "this is Kendall's τ, which also subtracts the pairs in the opposite order; here a share is asked for": (
            lambda p, o: 2 * same(p, o) - 1
        ),
        "this counts systems with the same rank; compare each system with each other one": (
            lambda p, o: float(np.mean(np.argsort(np.argsort(p)) == np.argsort(np.argsort(o))))
        ),
        "only neighbours in the list are compared; there are n (n − 1) / 2 pairs": (
            lambda p, o: float(np.mean([agree(p, o, i, i + 1) for i in range(len(p) - 1)]))
        ),
        "this is the share of pairs in the opposite order": lambda p, o: 1 - same(p, o),
        "a share is needed: divide by the number of pairs": lambda p, o: same(p, o) * len(p) * (len(p) - 1) / 2,
    }
    return Exercise(same, cases, mistakes)


@exercise(stars=2)
def who_is_better() -> Exercise:
    """Check ``function(ours, other, larger_is_better)``: 1 for ours, −1 for the other, 0 where it is undecided."""

    def paired(ours: np.ndarray, other: np.ndarray) -> float:
        differences = ours - other
        quantile = scipy.stats.t.ppf(0.975, len(differences) - 1)
        return quantile * differences.std(ddof=1) / np.sqrt(len(differences))

    def of_a_normal(ours: np.ndarray, other: np.ndarray) -> float:
        return 1.96 * (ours - other).std(ddof=1) / np.sqrt(len(ours))

    def of_groups(ours: np.ndarray, other: np.ndarray) -> float:
        quantile = scipy.stats.t.ppf(0.975, 2 * len(ours) - 2)
        return quantile * np.sqrt((ours.var(ddof=1) + other.var(ddof=1)) / len(ours))

    def better(
        ours: Float[Tensor, " n"], other: Float[Tensor, " n"], larger_is_better: bool, half_width: object = paired
    ) -> int:
        first, second = ours.numpy(), other.numpy()
        gap = first.mean() - second.mean()
        if abs(gap) <= half_width(first, second):
            return 0
        return 1 if (gap > 0) == larger_is_better else -1

    base = torch.tensor([0.21, 0.35, 0.28, 0.50, 0.41, 0.30], dtype=torch.float64)
    small = torch.tensor([0.02, 0.03, 0.01, 0.02, 0.03, 0.02], dtype=torch.float64)
    four = torch.tensor([0.05, 0.2, 0.12, 0.01], dtype=torch.float64)
    cases = {
        "a distance that is always smaller": (base - small, base, False),
        "a distance that is always larger": (base + small, base, False),
        "normals that are always larger": (base + small, base, True),
        "four subjects that scatter": (base[:4] + four, base[:4], False),
        "differences of both signs": (base + small - small.mean() - 1e-4, base, True),
    }
    mistakes = {
        "this is the interval of two independent groups; the same subjects are in both: use their differences": (
            lambda a, b, larger: better(a, b, larger, of_groups)
        ),
        "1.96 belongs to a normal distribution; with few subjects the quantile of Student's t is larger": (
            lambda a, b, larger: better(a, b, larger, of_a_normal)
        ),
        "the answer does not depend on larger_is_better: of normals, a larger value is better": (
            lambda a, b, larger: better(a, b, False)
        ),
        "the sign is reversed: 1 if the first system, ours, is better": lambda a, b, larger: -better(a, b, larger),
        "this compares the means only; where the interval contains zero, nothing is decided": (
            lambda a, b, larger: 1 if (a.mean() > b.mean()) == larger else -1
        ),
    }
    return Exercise(better, cases, mistakes)


@exercise(stars=3)
def best_motion() -> Exercise:
    """Check ``function(moving, fixed)``: rotation and translation (3, 4) with the least squared distances."""

    def rigid(
        moving: Float[Tensor, "n 3"], fixed: Float[Tensor, "n 3"], proper: bool = True, centred: bool = True
    ) -> Float[Tensor, "3 4"]:
        here, there = moving.mean(dim=0), fixed.mean(dim=0)
        left, _, right = torch.linalg.svd((fixed - there * centred).T @ (moving - here * centred))
        signs = torch.ones(3, dtype=moving.dtype)
        signs[2] = torch.linalg.det(left @ right).sign() if proper else 1.0
        rotation = left @ torch.diag(signs) @ right
        return torch.cat([rotation, (there - rotation @ here)[:, None]], dim=1)

    def transposed(motion: Tensor, moving: Tensor, fixed: Tensor) -> Tensor:
        rotation = motion[:, :3].T
        return torch.cat([rotation, (fixed.mean(dim=0) - rotation @ moving.mean(dim=0))[:, None]], dim=1)

    random = np.random.default_rng(3)
    points = torch.from_numpy(random.normal(size=(12, 3)) * [3.0, 2.0, 1.0] + [1.0, -2.0, 0.5])
    turn = torch.from_numpy(scipy.stats.special_ortho_group.rvs(3, random_state=4))
    noise = torch.from_numpy(random.normal(0, 0.1, (12, 3)))
    shift = torch.tensor([0.4, 1.0, -2.0], dtype=torch.float64)
    cases = {
        "a motion without noise": (points, points @ turn.T + shift),
        "a motion with noise": (points, points @ turn.T + shift + noise),
        "mirrored points": (points, points * points.new_tensor([1.0, 1.0, -1.0]) + shift),
        "points that do not move": (points, points.clone()),
    }
    mistakes = {
        "on some points this is a reflection (determinant −1); there, change the sign of the last singular vector": (
            lambda m, f: rigid(m, f, proper=False)
        ),
        "the rotation is that of the points as they are; subtract the mean of each set before the singular values": (
            lambda m, f: rigid(m, f, centred=False)
        ),
        "this moves the fixed points onto the moving ones": lambda m, f: rigid(f, m),
        "the rotation is transposed: fixed ≈ R moving + t for columns, which is moving Rᵀ + t for rows": (
            lambda m, f: transposed(rigid(m, f), m, f)
        ),
        "the translation is that without a rotation; the mean of the moving points is rotated, too": (
            lambda m, f: torch.cat([rigid(m, f)[:, :3], (f.mean(dim=0) - m.mean(dim=0))[:, None]], dim=1)
        ),
    }
    return Exercise(rigid, cases, mistakes)


# Chapter 27: the rate of a candidate, the average of weights, and the luck of the best of several scores.


@exercise(stars=1)
def chosen_rate() -> Exercise:
    """Check ``function(rates, distances)``: the rate with the lowest mean distance over the second half of checks."""

    def late(checks: list[float]) -> float:
        return float(np.mean(checks[len(checks) // 2 :]))

    def chosen(rates: list[float], distances: list[list[float]]) -> float:
        return rates[int(np.argmin([late(each) for each in distances]))]

    steady, noisy = [0.40, 0.35, 0.30, 0.29, 0.28, 0.27], [0.40, 0.36, 0.33, 0.25, 0.36, 0.35]
    cases = {
        "three trainings that fall": ([1e-4, 3e-4, 1e-3], [[0.4, 0.38, 0.37, 0.36], steady[:4], noisy[:2] * 2]),
        "one check that is low by chance": ([5e-4, 2e-3], [steady, noisy]),
        "a fast start and a bad end": ([5e-4, 2e-3], [[0.5, 0.45, 0.33, 0.30], [0.3, 0.3, 0.34, 0.33]]),
        "a last check that is low by chance": ([5e-4, 2e-3], [[0.4, 0.4, 0.38, 0.38, 0.39, 0.26], steady]),
    }
    mistakes = {
        "this compares the last checks only; one check is noisy: take the mean over the second half": (
            lambda r, d: r[int(np.argmin([each[-1] for each in d]))]
        ),
        "this compares the lowest checks; the lowest of several noisy numbers is too low: take the mean over the "
        "second half": (lambda r, d: r[int(np.argmin([min(each) for each in d]))]),
        "this is the mean over all checks; the first half says how fast a training begins, not where it ends": (
            lambda r, d: r[int(np.argmin([np.mean(each) for each in d]))]
        ),
        "this is the number of the rate, not the rate": lambda r, d: int(np.argmin([late(each) for each in d])),
        "the smallest distance is the best": lambda r, d: r[int(np.argmax([late(each) for each in d]))],
    }
    return Exercise(chosen, cases, mistakes)


@exercise(stars=2)
def averaged_weights() -> Exercise:
    """Check ``function(weights, decay)``: the exponential average after the last step, begun with the first weights."""

    def averaged(weights: Float[Tensor, "t k"], decay: float) -> Float[Tensor, " k"]:
        return functools.reduce(lambda average, own: decay * average + (1 - decay) * own, weights[1:], weights[0])

    steps = torch.tensor([[1.0, -2.0], [0.5, 3.0], [2.0, 1.0], [4.0, 0.0]], dtype=torch.float64)
    cases = {
        "four steps of two weights": (steps, 0.9),
        "a short memory": (steps, 0.2),
        "a single step": (steps[2:3], 0.99),
    }
    mistakes = {
        "these are the weights of the last step; the average remembers earlier ones": lambda w, c: w[-1],
        "this is the mean of all steps; later steps have larger shares": lambda w, c: w.mean(dim=0),
        "`decay` is the share of the average so far, not that of the step": lambda w, c: averaged(w, 1 - c),
        "the average begins with the first weights, not with zero": (
            lambda w, c: averaged(torch.cat([0 * w[:1], w]), c)
        ),
        "this goes through the steps from the last one to the first": lambda w, c: averaged(w.flip(0), c),
    }
    return Exercise(averaged, cases, mistakes)


@exercise(stars=3)
def luck_of_the_best() -> Exercise:
    """Check ``function(n, deviation)``: the mean of the smallest of n equal scores with normal errors, minus theirs."""

    def luck(n: int, deviation: float) -> float:
        normal = scipy.stats.norm
        return deviation * scipy.integrate.quad(lambda x: x * n * normal.pdf(x) * normal.sf(x) ** (n - 1), -12, 12)[0]

    cases = {"two scores": (2, 0.01), "a single score": (1, 0.02), "fourteen scores": (14, 0.006)}
    mistakes = {
        "the smallest score is too small, so the number is negative": lambda n, s: -luck(n, s),
        "this is the luck for a deviation of one; it is proportional to the deviation": lambda n, s: luck(n, 1.0),
        "this is the error of a mean of n scores; the smallest of them is asked for": lambda n, s: -s / n**0.5,
        "this is a quantile; the mean of the smallest score is asked for": (
            lambda n, s: s * float(scipy.stats.norm.ppf(1 / (n + 1)))
        ),
        "this is the limit for a very large number of scores; n is small": lambda n, s: -s * (2 * np.log(n)) ** 0.5,
    }
    return Exercise(luck, cases, mistakes)


# Chapter 28: what the fall of a loss means, where one training leads another, and a forecast with its interval.


@exercise(stars=1)
def diagnosis() -> Exercise:
    """Check ``function(seen, new, distance)``: 0 no descent, 1 overfitted, 2 insensitive to the distance, 3 helps."""

    def diagnose(seen: float, new: float, distance: float) -> int:
        return next((k for k, quotient in enumerate((seen, new, distance)) if quotient >= 1), 3)

    cases = {
        "a loss and a distance that fall": (0.7, 0.8, 0.9),
        "a distance that grows": (0.7, 0.8, 1.2),
        "a loss that grows on new subjects, with the distance": (0.7, 1.1, 1.2),
        "a loss that grows on new subjects alone": (0.7, 1.1, 0.9),
        "a loss that grows on all subjects": (1.1, 1.2, 1.3),
        "a loss that grows on training subjects only": (1.1, 0.9, 0.9),
        "a distance that stays": (0.7, 0.8, 1.0),
        "a loss that stays": (1.0, 0.9, 0.9),
    }
    mistakes = {
        "a distance that grows where the loss grows, too, says nothing about the loss; ask for the loss first": (
            lambda seen, new, distance: 2 if seen < 1 and distance >= 1 else diagnose(seen, new, distance)
        ),
        "a loss that falls on training subjects only is overfitted; the quotient of new subjects is not used": (
            lambda seen, new, distance: diagnose(seen, seen, distance)
        ),
        "the quotient of training subjects is not used; only a loss that falls there can be overfitted": (
            lambda seen, new, distance: diagnose(new, new, distance)
        ),
        "a quotient of exactly 1 is no improvement": (
            lambda seen, new, distance: diagnose(seen - 1e-9, new - 1e-9, distance - 1e-9)
        ),
        "the quotients are after / before: below 1 is an improvement": (
            lambda seen, new, distance: diagnose(1 / seen, 1 / new, 1 / distance)
        ),
    }
    return Exercise(diagnose, cases, mistakes)


@exercise(stars=2)
def first_lead() -> Exercise:
    """Check ``function(steps, ours, other)``: the step from which on ours is nearer at every check, −1 if none."""

    def lead(steps: list[int], ours: list[float], other: list[float]) -> int:
        behind = [i for i, (a, b) in enumerate(zip(ours, other)) if a >= b]
        first = behind[-1] + 1 if behind else 0
        return steps[first] if first < len(steps) else -1

    steps = [280, 560, 840, 1120, 1400]
    cases = {
        "a lead that begins late": (steps, [0.5, 0.4, 0.3, 0.25, 0.2], [0.4, 0.35, 0.31, 0.3, 0.3]),
        "a lead that is lost once": (steps, [0.5, 0.3, 0.4, 0.25, 0.2], [0.4, 0.35, 0.31, 0.3, 0.3]),
        "a lead from the beginning": (steps, [0.3, 0.3, 0.2, 0.2, 0.1], [0.4, 0.35, 0.31, 0.3, 0.3]),
        "no lead at the end": (steps, [0.3, 0.3, 0.2, 0.2, 0.3], [0.4, 0.35, 0.31, 0.3, 0.29]),
    }
    mistakes = {
        "this is the first check at which ours is nearer; at a later check it may be farther again": (
            lambda s, a, b: next((step for step, x, y in zip(s, a, b) if x < y), -1)
        ),
        "this is the number of the check; the step is asked for": lambda s, a, b: lead(list(range(len(s))), a, b),
        "this is the step from which on the other one is nearer": lambda s, a, b: lead(s, b, a),
        "this is the last check at which ours is not nearer; the next one is asked for": (
            lambda s, a, b: next((step for step, x, y in zip(s[::-1], a[::-1], b[::-1]) if x >= y), -1)
        ),
        "if ours is not nearer at the last check, the answer is −1": (
            lambda s, a, b: s[0] if lead(s, a, b) == -1 else lead(s, a, b)
        ),
    }
    return Exercise(lead, cases, mistakes)


@exercise(stars=3)
def forecast() -> Exercise:
    """Check ``function(steps, distances, at)``: a power law, continued: the distance there, and its interval."""

    def of_student(n: int) -> float:
        return float(scipy.stats.t.ppf(0.975, n - 2))

    def continued(
        steps: Float[Tensor, " n"],
        distances: Float[Tensor, " n"],
        at: float,
        own: float = 1.0,
        far: float = 1.0,
        quantile: object = of_student,
    ) -> Float[Tensor, " 3"]:
        x, y, n = steps.log(), distances.log(), len(steps)
        away = x - x.mean()
        slope = (away * y).sum() / away.square().sum()
        rest = y - y.mean() - slope * away
        beyond = float(np.log(at)) - x.mean()
        spread = own + 1 / n + far * beyond**2 / away.square().sum()
        half = quantile(n) * (rest.square().sum() / (n - 2) * spread).sqrt()
        middle = y.mean() + slope * beyond
        return torch.stack([middle, middle - half, middle + half]).exp()

    steps = torch.tensor([2.0, 4.0, 6.0, 8.0, 12.0], dtype=torch.float64)
    noise = torch.tensor([1.02, 0.97, 1.01, 1.03, 0.98], dtype=torch.float64)
    cases = {
        "distances that fall and scatter": (steps, 0.5 * steps**-0.3 * noise, 40.0),
        "a forecast within the checks": (steps, 0.5 * steps**-0.3 * noise, 7.0),
        "distances that do not fall": (steps, 0.3 * noise, 40.0),
        "three checks": (steps[:3], 0.4 * steps[:3] ** -0.5 * noise[:3], 12.0),
    }
    mistakes = {
        "this is the interval of the line; a single check scatters about it, too: there is a 1 under the root": (
            lambda s, d, at: continued(s, d, at, own=0.0)
        ),
        "1.96 belongs to a normal distribution; with few checks the quantile of Student's t is larger": (
            lambda s, d, at: continued(s, d, at, quantile=lambda n: 1.96)
        ),
        "a line has two numbers, so that n − 2 degrees of freedom are left": (
            lambda s, d, at: continued(s, d, at, quantile=lambda n: scipy.stats.t.ppf(0.975, n - 1))
        ),
        "the interval does not grow with the distance from the checks; the slope is uncertain, too": (
            lambda s, d, at: continued(s, d, at, far=0.0)
        ),
        "this line is fitted to the numbers as they are; a power law is a line between logarithms": (
            lambda s, d, at: continued(s.exp(), d.exp(), float(np.exp(at))).log()
        ),
        "these are logarithms; return distances": lambda s, d, at: continued(s, d, at).log(),
    }
    return Exercise(continued, cases, mistakes)
