"""Find a study: a file anywhere, a name in the lab's configuration, a package, or one we ship."""

import hashlib
import importlib
import importlib.util
import sys
from collections.abc import Iterable, Mapping
from dataclasses import replace
from importlib.machinery import SourceFileLoader
from importlib.metadata import entry_points
from pathlib import Path
from types import CodeType, ModuleType
from typing import Final

from visavis.lab.errors import DesignError, UsageError
from visavis.lab.yaml_lines import did_you_mean
from visavis.recording.typed_names import typed_path
from visavis.study.declaration import Study
from visavis.study.sections import import_object
from visavis.study.study_errors import MODULE_OF_STUDY, explain, forgotten_yields, line_of
from visavis.study.trial import STEPS

SHIPPED_STUDIES: Final[Mapping[str, str]] = {
    "stare": "visavis.experiments.stare.study:study",
    "crowd": "visavis.experiments.crowd.study:study",
    "waving": "visavis.experiments.waving.study:study",
    "waving_page": "visavis.experiments.waving.on_page:study",
    "interpolation": "visavis.experiments.interpolation.study:study",
    "hybrid": "visavis.experiments.hybrid.study:study",
    "cameras": "visavis.experiments.cameras.study:study",
    "adjectives": "visavis.experiments.adjectives.study:study",
    "gestures": "visavis.experiments.gestures.study:study",
    "gesture_pairs": "visavis.experiments.gestures.pairs:study",
    "matching": "visavis.experiments.matching.study:study",
}
"""The studies Visavis comes with, as an entry point would name them."""
GROUP: Final = "visavis.studies"
"""Entry points of installed packages: a name, and a `Study` (or what makes one)."""


def declared_study(reference: str, of_lab: Mapping[str, Path] | None = None) -> Study:
    """Return a study by its file's path, or by name; `of_lab` are the lab's own study files.

    Raises:
        UsageError: there is none, with the nearest name.
        DesignError: the file cannot be read, or declares no study.
    """
    if is_file(reference):
        return study_of_file(Path(reference))
    own = of_lab or {}
    if reference in own:
        study = study_of_file(own[reference])
        if study.name != reference:
            raise DesignError(
                f"{own[reference]} declares the study {study.name}, not {reference}; correct "
                "studies: in lab_config.yaml"
            )
        return study
    if reference in SHIPPED_STUDIES:
        return _of_object(SHIPPED_STUDIES[reference])
    plugins = {point.name: point for point in entry_points(group=GROUP)}
    if reference in plugins:
        return _of_object(plugins[reference].value)
    names = (*SHIPPED_STUDIES, *own, *plugins)
    raise UsageError(
        f"there is no study {reference!r}{did_you_mean(reference, names)}; or give a study's "
        "file, such as ./duel.py"
    )


def is_file(reference: str) -> bool:
    """Tell whether a reference to a study is a file's path and not a name."""
    return reference.endswith(".py") or "/" in reference or "\\" in reference


def reference_of(study: Study) -> str:
    """Return what finds a study from any folder and process: its file, or its name."""
    path = study.files.path
    return study.name if path is None else str(path)


def typed_reference(study: Study) -> str:
    """Return what finds a study when it is typed in the present folder: its name, or its file."""
    return study.name if study.files.path is None else typed_path(study.files.path)


def digest_of(path: Path, *, with_words: bool = True) -> str:
    """Return the SHA-256 of a study file with its texts, to notice changes.

    It includes the files of the studies it was derived from, and its own questionnaires; without
    `with_words` the study files alone.
    """
    digest = hashlib.sha256()
    study: Study | None = study_of_file(path)
    while study is not None and (own := study.files.path) is not None:
        files = study.files
        texts = () if files.texts is None else (files.folder / files.texts).glob("*.yaml")
        questionnaire_files = (files.folder / f"{name}.yaml" for name in study.asks.questionnaires)
        words = (*sorted(texts), *questionnaire_files) if with_words else ()
        for file in (own, *words):
            digest.update(file.read_bytes() if file.is_file() else b"")
        study = study.base
    return digest.hexdigest()


def study_of_file(path: Path) -> Study:
    """Read a study file.

    Raises:
        UsageError: there is no such file.
        DesignError: it cannot be read, or declares no study, or several.
    """
    path = path.resolve()
    if not path.is_file():
        near = did_you_mean(path.name, [p.name for p in path.parent.glob("*.py")])
        raise UsageError(f"there is no study file {path}{near}")
    module = _module_of(path)
    studies = [v for v in vars(module).values() if isinstance(v, Study)]
    main_study = vars(module).get("study")
    if isinstance(main_study, Study):
        studies = [main_study]  # the file may hold others, such as its base
    if len(studies) != 1:
        raise DesignError(
            f"{path} declares {len(studies) or 'no'} studies; a study file makes one: "
            'study = Study("NAME", …)'
        )
    study = studies[0]
    study.files = replace(study.files, path=path, folder=path.parent)
    for line, answer, step in forgotten_yields(path, STEPS):
        raise DesignError(
            f"{path}, line {line}: {step}(…) is made and not performed; write {answer}yield "
            f"{step}(…)"
        )
    _ = study.trial_plan
    return study


class _UncachedLoader(SourceFileLoader):
    """Compiles a study's file whenever it is read.

    Python takes byte code for current where the second of the last change and the length agree, so
    a file changed twice within a second could run as it was before.
    """

    def get_code(self, fullname: str) -> CodeType:
        """Return the code of the file as it is now; no byte code is read or written."""
        return compile(self.get_data(self.path), self.path, "exec", dont_inherit=True)


def _module_of(path: Path) -> ModuleType:
    name = f"{MODULE_OF_STUDY}{path.stem}"
    loader = _UncachedLoader(name, str(path))
    spec = importlib.util.spec_from_file_location(name, path, loader=loader)
    if spec is None or path.suffix != ".py":
        raise DesignError(f"{path} is not a Python file")
    module = importlib.util.module_from_spec(spec)
    sys.path.insert(0, str(path.parent))
    sys.modules[name] = module
    try:
        loader.exec_module(module)
    except SyntaxError as error:
        raise DesignError(f"{path}, line {error.lineno}: {error.msg}") from error
    except Exception as error:
        raise DesignError(f"{line_of(error) or path}: {explain(error)}") from error
    finally:
        sys.path.remove(str(path.parent))
        if str(path.parent) not in sys.path:  # for functions that it names as "module:function"
            sys.path.append(str(path.parent))
    return module


def _of_object(reference: str) -> Study:
    target = import_object(reference)
    study = target if isinstance(target, Study) else target()
    if not isinstance(study, Study):
        raise DesignError(f"{reference} is a {type(study).__name__}; an entry point names a Study")
    return study


def known_studies(of_lab: Iterable[str] = ()) -> tuple[str, ...]:
    """Return the names of every study that can be found by name."""
    return (*SHIPPED_STUDIES, *of_lab, *(p.name for p in entry_points(group=GROUP)))
