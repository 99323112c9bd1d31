"""The options of a pytest run about other runs: `--drive-save`, `--drive-compare` and their companions."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from pytest_drive_robust.errors import UsageError
from pytest_drive_robust.options.option import GivenText, OptionSource, asked_for, option, read_fields
from pytest_drive_robust.options.parsers import require_writable, start_folder
from pytest_drive_robust.regression.allowance import Allowance, parse_allowances
from pytest_drive_robust.regression.fingerprint import MismatchPolicy, parse_policy
from pytest_drive_robust.regression.references import AUTO, BASELINES, StoredRuns, check_run_name, names_file


def _save(given: GivenText) -> str:
    """Return the name of the run to save. Raises `UsageError` for a name or place that could not be stored at the end.

    A folder is refused, because `--drive-save suites` swallows the folder that was meant to be collected.
    """
    if not given.text:
        return ""
    require_writable(given, StoredRuns(_root(given).absolute()).path)
    if given.text == AUTO:
        return AUTO
    if Path(given.text).is_dir():
        raise UsageError(
            f"{given.flag} is {given.text!r}, which is a folder here. If it was meant as a path to collect, put it "
            f"before {given.flag}; else choose another name for the run, as in {given.flag}=before."
        )
    return check_run_name(given.text, source=given.flag)


def _allowances(given: GivenText) -> tuple[Allowance, ...]:
    return parse_allowances([given.text] if given.text else (), source=given.flag)


def _compare(given: GivenText) -> str:
    """Return the reference as given; a file that the ini file names is returned with its whole path.

    A folder or test file is refused, because `--drive-compare suites/` swallows the folder that was meant to be
    collected.
    """
    reference, start = given.text, start_folder(given)
    if "::" in reference or reference.endswith(".py") or (reference and (start / reference).is_dir()):
        raise UsageError(
            f"--drive-compare is {reference!r}, expected a stored run, a JSON file of a run, latest or baseline. If it "
            "was meant as a path to collect, put it before --drive-compare."
        )
    in_ini = given.source is not None and not asked_for(given.flag, given.source)
    return str(start / reference) if reference and in_ini and names_file(reference, start) else reference


def _baselines(given: GivenText) -> Path:
    return start_folder(given) / given.text if given.text else _root(given) / BASELINES


def _waivers(given: GivenText) -> Path | None:
    """Return the given file, which must exist, else `suites/waivers.toml` if there is one; None for `"none"`."""
    if given.text == "none":
        return None
    if given.text:
        path = start_folder(given) / given.text
        if not path.is_file():
            raise UsageError(f"{given.flag} is {given.text!r}, but there is no file {str(path)!r}.")
        return path
    usual = _root(given) / "suites" / "waivers.toml"
    return usual if usual.is_file() else None


def _root(given: GivenText) -> Path:
    return Path() if given.source is None else given.source.rootpath


@dataclass(frozen=True, slots=True)
class RegressionOptions:
    """The options about other runs; `save` and `compare` are empty when not given, `waivers` is None without a file.

    `save` is a name, or `"auto"`; `compare` is a reference that `references` reads; `home` is the root folder of the
    run.
    """

    home: Path
    save: str = option("--drive-save", parse=_save)
    compare: str = option("--drive-compare", parse=_compare)
    allowances: tuple[Allowance, ...] = option("--drive-fail-on", parse=_allowances)
    policy: MismatchPolicy = option("--drive-on-mismatch", parse=parse_policy)
    baselines: Path = option("--drive-baselines", parse=_baselines)
    waivers: Path | None = option("--drive-waivers", parse=_waivers)

    @classmethod
    def from_pytest_config(cls, config: OptionSource) -> RegressionOptions:
        """Read the options. Raises `UsageError` for values that cannot be used."""
        options = cls(home=config.rootpath, **read_fields(cls, config))
        for flag in ("--drive-fail-on", "--drive-on-mismatch"):
            if not options.compare and asked_for(flag, config):
                raise UsageError(f"{flag} says how runs are compared. Add --drive-compare RUN, or leave {flag} out.")
        if not options.compare and asked_for("--drive-baselines", config):
            raise UsageError(
                "--drive-baselines is read to compare runs. Add --drive-compare, or leave --drive-baselines out."
            )
        return options

    @property
    def drives_all(self) -> bool:
        """True when every route is driven, even after a verdict was reached: a comparison needs all routes."""
        return bool(self.save or self.compare)

    def in_words(self) -> tuple[str, ...]:
        """Return the options that pytest's header shows, as `name=value`."""
        told = (("save", self.save), ("compare", self.compare))
        return tuple(f"{name}={value}" for name, value in told if value)
