"""What a pytest run was asked about other runs: the options `--drive-save`, `--drive-compare` and their company."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from pytest_drive_robust.errors import UsageError
from pytest_drive_robust.options.run import read_option
from pytest_drive_robust.options.table import REGRESSION_OPTIONS
from pytest_drive_robust.regression.allowance import Allowance, parse_allowances
from pytest_drive_robust.regression.fingerprint import MismatchPolicy, parse_policy
from pytest_drive_robust.regression.references import BASELINES
from pytest_drive_robust.regression.runs import AUTO, check_run_name

if TYPE_CHECKING:
    from pytest_drive_robust.options.run import OptionSource

__all__ = ["RegressionOptions"]


@dataclass(frozen=True, slots=True)
class RegressionOptions:
    """`save` and `compare` are empty when not asked for; `waivers` is None where there is no such file.

    `save` is a name, or `"auto"`; `compare` is a reference as `references` reads it; `home` is the root folder of the
    run.
    """

    home: Path
    save: str
    compare: str
    allowances: tuple[Allowance, ...]
    policy: MismatchPolicy
    baselines: Path
    waivers: Path | None

    @classmethod
    def from_pytest_config(cls, config: OptionSource, home: Path) -> RegressionOptions:
        """Read the options. Raises `UsageError` for values that cannot be used."""
        given = {option.ini: read_option(config, option) for option in REGRESSION_OPTIONS}
        save, baselines = given["drive_save"], given["drive_baselines"]
        return cls(
            home=home,
            save=check_run_name(save, source="--drive-save") if save not in ("", AUTO) else save,
            compare=_not_a_place(given["drive_compare"]),
            allowances=parse_allowances([given["drive_fail_on"]], source="--drive-fail-on"),
            policy=parse_policy(given["drive_on_mismatch"]),
            baselines=home / baselines if baselines else home / BASELINES,
            waivers=_waivers(given["drive_waivers"], home),
        )

    @property
    def drives_all(self) -> bool:
        """True when every route is driven, also those that a verdict can do without: a comparison needs them."""
        return bool(self.save or self.compare)

    def in_words(self) -> tuple[str, ...]:
        """What the header says about it."""
        told = (("save", self.save), ("compare", self.compare))
        return tuple(f"{name}={value}" for name, value in told if value)


def _not_a_place(reference: str) -> str:
    """`--drive-compare suites/` takes the folder that was meant to be collected: refused with advice."""
    if "::" in reference or reference.endswith(".py") or (reference and Path(reference).is_dir()):
        raise UsageError(
            f"--drive-compare is {reference!r}, expected a stored run, a JSON file of a run, latest or baseline. If it "
            "was meant as a path to collect, put it before --drive-compare."
        )
    return reference


def _waivers(given: str, home: Path) -> Path | None:
    """The file that was named, which must be there, or the usual one where it is."""
    if given:
        path = home / given
        if not path.is_file():
            raise UsageError(f"--drive-waivers is {given!r}, but there is no file {str(path)!r}.")
        return path
    usual = home / "suites" / "waivers.toml"
    return usual if usual.is_file() else None
