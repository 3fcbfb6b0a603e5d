"""The ranking of friction laws that are fitted to the same records."""

from __future__ import annotations

import numpy as np
import pytest

import hybridsim as hs

T = np.linspace(0.0, 1.5, 60)


def slider(law: str, load: str | float = 2, **parameters: float) -> hs.Model:
    """A block that slides to rest, x'' = -f."""
    return hs.Model(
        "slider",
        parameters={"v0": 2.0},
        states=[hs.State("x", 0, "v", nominal=1), hs.State("v", "v0", "-f", nominal=1)],
        contacts=[hs.Contact("f", "v", load, law, parameters)],
    )


def measured(*, sigma: float, seed: int = 0) -> dict[str, np.ndarray]:
    """The place of a block under Coulomb friction in closed form, v0 t - 2 mu t^2/2 until it rests, and noise."""
    until = np.minimum(T, 2.0 / (2.0 * 0.6))
    return {
        "t": T,
        "x": 2.0 * until - 0.6 * until**2 + sigma * np.random.default_rng(seed).normal(size=len(T)),
    }


LAWS = [("viscous", {"c": (0.1, 5.0)}), ("coulomb", {"mu": (0.1, 2.0)})]


def test_the_law_of_the_data_is_first() -> None:
    """AICc with the formula written out, from the residuals of each fit."""
    data = measured(sigma=0.01)
    found = hs.fit_laws(slider("coulomb", mu=0.3), data, LAWS)
    assert found.labels == ("coulomb", "viscous")
    assert found.rows[0].fit.values["f_mu"] == pytest.approx(0.6, abs=0.01)
    for row in found.rows:
        off = row.fit.residuals[0]["x"]
        expected = (
            60 * np.log((off**2).sum() / 60) + 2 * 2 + 2 * 2 * 3 / (60 - 2 - 1)
        )  # c or mu, and the noise
        assert row.aicc == pytest.approx(expected, rel=1e-12)
    assert sum(found.weights.values()) == pytest.approx(1.0)
    assert found.weights["coulomb"] > 0.999
    assert "viscous" in found.report() and "coulomb" in repr(found)


NESTED = [("viscous", {"mu": (0.1, 2.0), "c": (-0.5, 0.5)}), ("coulomb", {"mu": (0.1, 2.0)})]


@pytest.mark.parametrize("held_out", [None, {"t": T, "x": measured(sigma=0.0)["x"]}])
def test_exact_data_have_the_law_with_fewer_unknowns(held_out: dict[str, np.ndarray] | None) -> None:
    """Both laws describe data without noise, and the residuals are errors of the runs.

    The difference of AICc is then that of 2 K + 2 K (K + 1)/(n - K - 1) with K = 3 and 2.
    """
    found = hs.fit_laws(slider("coulomb", mu=0.3), measured(sigma=0.0), NESTED, held_out=held_out)
    assert found.labels == ("coulomb", "viscous")
    assert found.rows[1].fit.values == {"f_mu": pytest.approx(0.6), "f_c": pytest.approx(0.0, abs=1e-6)}
    assert found.rows[1].aicc - found.rows[0].aicc == pytest.approx(6 + 24 / 56 - 4 - 12 / 57, rel=1e-9)


def test_the_criterion_with_a_given_noise() -> None:
    """The sum of squares over the noise, and no unknown for the noise."""
    found = hs.fit_laws(slider("coulomb", mu=0.3), measured(sigma=0.01), LAWS[1:], noise={"x": 0.02})
    off = found.rows[0].fit.residuals[0]["x"]
    assert found.rows[0].aicc == pytest.approx((off**2).sum() / 0.02**2 + 2 + 2 * 2 / (60 - 1 - 1), rel=1e-12)


def test_records_that_are_held_out_rank_the_laws() -> None:
    """The fitted run against the closed form of a faster block, relative to the deviation of its place."""
    until = np.minimum(T, 3.0 / (2.0 * 0.6))
    x = 3.0 * until - 0.6 * until**2
    held = hs.Record({"t": T, "x": x}, params={"v0": 3.0})
    found = hs.fit_laws(slider("coulomb", mu=0.3), measured(sigma=0.01), LAWS, held_out=held)
    assert found.labels == ("coulomb", "viscous")
    mu = found.rows[0].fit.values["f_mu"]
    until = np.minimum(T, 3.0 / (2.0 * mu))
    off = x - (3.0 * until - mu * until**2)
    assert found.rows[0].held_out == pytest.approx(np.sqrt((off**2).mean()) / x.std(), rel=1e-5)


def test_shared_unknowns_and_fixed_parameters() -> None:
    """The speed at the start is fitted with each law, and mu of one of them is given."""
    found = hs.fit_laws(
        slider("coulomb", mu=0.3), measured(sigma=0.0), [("coulomb", {"mu": 0.6})], {"v0": (1.0, 3.0)}
    )
    assert found.rows[0].fit.values == {"v0": pytest.approx(2.0, abs=1e-6)}


def test_one_law_with_several_fixed_parameters() -> None:
    """The data have no viscous part, so that c = 0 is better than c = 1/2; both labels contain c."""
    laws = [("viscous", {"mu": (0.1, 2.0), "c": 0.5}), ("viscous", {"mu": (0.1, 2.0), "c": 0.0})]
    found = hs.fit_laws(slider("coulomb", mu=0.3), measured(sigma=0.01), laws)
    assert found.labels == ("viscous (c=0.0)", "viscous (c=0.5)")
    assert found.rows[0].fit.values["f_mu"] == pytest.approx(0.6, abs=0.01)


def test_laws_that_cannot_be_fitted_are_refused() -> None:
    """A law twice, a parameter without a guess, a robust loss, and no laws."""
    model, data = slider("coulomb", mu=0.3), measured(sigma=0.01)
    with pytest.raises(hs.UsageError, match="'coulomb' twice"):
        hs.fit_laws(model, data, [LAWS[1], LAWS[1]])
    with pytest.raises(hs.UsageError, match="mu of coulomb has no guess"):
        hs.fit_laws(model, data, [("coulomb", {"mu": hs.Unknown(0.1)})])
    with pytest.raises(hs.UsageError, match="no option `loss`"):
        hs.fit_laws(model, data, LAWS, loss="huber")
    with pytest.raises(hs.UsageError, match="laws"):
        hs.fit_laws(model, data, [])
    with pytest.raises(hs.UsageError, match="an entry of `laws`"):
        hs.fit_laws(model, data, [("coulomb", {"mu": (1, 2, 3)})])


def test_a_law_without_unknowns_or_runs_is_named() -> None:
    """Fixed parameters, a guess with mu_s = 0.3 below mu_k = 0.5, and a load that becomes negative."""
    model, data = slider("coulomb", mu=0.3), measured(sigma=0.01)
    with pytest.raises(hs.UsageError, match="'viscous' has no unknown"):
        hs.fit_laws(model, data, [LAWS[1], ("viscous", {"c": 1.0})])
    with pytest.raises(hs.ModelError, match=r"slip force 1 .* guess f_mu_s = 0.3, f_mu_k = 0.5"):
        hs.fit_laws(model, data, [LAWS[0], ("static-kinetic", {"mu_s": (0.1, 0.5), "mu_k": (0.1, 0.9)})])
    with pytest.raises(hs.SimulationError, match="'coulomb' cannot be fitted: the runs of the records stop"):
        hs.fit_laws(slider("coulomb", load="1 - t", mu=0.3), data, [("coulomb", {"mu": (0.1, 0.9)})])


def test_too_few_samples_do_not_rank_laws() -> None:
    """AICc of two unknowns, one parameter and the noise, needs four samples, and held-out records need one."""
    model, data = slider("coulomb", mu=0.3), measured(sigma=0.01)
    few = {name: values[5:8] for name, values in data.items()} | {"t": T[5:8]}
    with pytest.raises(hs.UsageError, match="3 samples are too few to rank the laws"):
        hs.fit_laws(model, hs.Record(few, t0=0.0), LAWS)
    with pytest.raises(hs.UsageError, match="`held_out` contains no sample"):
        hs.fit_laws(model, data, LAWS[1:], held_out={"t": T, "x": np.full(len(T), np.nan)})


def test_the_picture() -> None:
    """Two axes: the samples with one run for each law, and the residuals."""
    found = hs.fit_laws(slider("coulomb", mu=0.3), measured(sigma=0.01), LAWS)
    upper, lower = found.plot().axes
    assert len(upper.lines) == 3 and len(lower.lines) == 3
