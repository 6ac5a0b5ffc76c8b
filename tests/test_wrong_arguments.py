"""Whatever is given to a public call: it works, or tells in one line which argument is wrong, and why."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.small_scenes import mixed_scene

import incpt
from incpt.core.errors import LONGEST_MESSAGE, InputError, OutputError
from incpt.device.device import Device
from incpt.scene.model import Object


class Stranger:
    """A type that nobody expects."""


WRONG: Mapping[str, Any] = {
    "None": None,
    "a truth value": True,
    "a number": 5,
    "a fraction": 0.5,
    "not a number": float("nan"),
    "a huge number": 10**5000,
    "a text": "nothing",
    "bytes": b"nothing",
    "a list": [1, 2, 3],
    "an empty list": [],
    "texts": ["a", "b", "c"],
    "uneven rows": [[1], [2, 3]],
    "a mapping": {"a": 1},
    "a mapping of two": {"width": 4, "height": 3},
    "an array": np.zeros((3, 2)),
    "an array of no dimension": np.array(5.0),
    "an array of texts": np.array([["a", "b"]]),
    "an object": incpt.Object("a", incpt.shape("cube"), "red"),
    "a mesh": incpt.shape("cube"),
    "a material": incpt.Material(),
    "a class": incpt.Scene,
    "a stranger": Stranger(),
}

CORNELL = Path(__file__).parents[1] / "scenes" / "cornell.toml"
SCENE = mixed_scene(size=(16, 8))
RIGHT: Mapping[str, Mapping[str, Any]] = {
    "Mesh": {"vertices": np.eye(3), "faces": [[0, 1, 2]]},
    "Image": {"pixels": np.ones((2, 4, 3))},
    "Bitmap": {"pixels": np.ones((2, 4, 3))},
    "Texture": {"bitmap": incpt.Bitmap(np.ones((2, 4, 3)))},
    "load_bitmap": {"path": "a.png"},
    "Object": {"name": "a", "mesh": incpt.shape("cube"), "material": "red"},
    "Light": {"name": "a", "kind": "point"},
    "Camera.image_plane": {"aspect": 2.0},
    "Camera.project": {"points": np.eye(3), "aspect": 2.0},
    "Camera.blur": {"points": np.eye(3), "aspect": 2.0},
    "Camera.rays": {"places": np.eye(2), "aspect": 2.0},
    "Camera.fov_y_at": {"aspect": 2.0},
    "Camera.focal_length_at": {"aspect": 2.0},
    "Camera.lens_radius": {"aspect": 2.0},
    "Camera.shift_at": {"aspect": 2.0},
    "Session": {"scene": SCENE},
    "Session.edit": {"scene": SCENE},
    "Session.end_drag": {"since": SCENE},
    "Session.configure": {"settings": SCENE.settings},
    "Session.render": {"spp": 1},
    "Session.pass_image": {"name": "radiance"},
    "Session.pick": {"pixel": (3, 3)},
    "Session.pick_point": {"point": (0.5, 0.5)},
    "Session.place_at": {"point": (0.5, 0.5)},
    "Scene.object": {"name": "red cube"},
    "Scene.light": {"name": "lamp"},
    "Scene.placed": {"name": "red cube"},
    "Scene.material": {"name": "red"},
    "Scene.without_light": {"name": "lamp"},
    "Scene.without_object": {"name": "red cube"},
    "Transform.from_matrix": {"matrix": np.eye(4)},
    "Transform.moved_to": {"matrix": np.eye(4)},
    "diff": {"old": SCENE, "new": SCENE},
    "export": {"scene": SCENE, "path": "a.glb"},
    "load": {"path": CORNELL},
    "load_image": {"path": "a.exr"},
    "load_mesh": {"path": "a.obj"},
    "pack": {"scene": SCENE, "path": "a"},
    "save": {"scene": SCENE, "path": "a.toml"},
    "shape": {"name": "cube"},
    "tone_map": {"linear": np.ones((2, 2, 3))},
    "write_exr": {"path": "a.exr", "layers": {"RGB": np.ones((2, 2, 3))}},
    "write_png": {"path": "a.png", "image": np.ones((2, 2, 3))},
}
"""Arguments with which each call works, where it needs any."""
WORDS = {
    "choice": ("device", "--device"), "device": ("device", "--device"), "layers": ("layers", "layer "),
    "linear": ("image",), "pixels": ("pixels", "image"),
    "name": ("name", "camera ", "object ", "light ", "material ", "shape ", "pass "),
}  # fmt: skip
"""How messages begin, where not with the argument's name."""
MADE_BY_INCPT = {"Change", "FirstHits", "Mode", "Snapshot", "StepReport"}
"""Values that nobody else makes."""


def _functions(name: str) -> dict[str, Callable[..., Any]]:
    """A public call, or the one that makes a value and its methods. Those of devices are for incpt itself."""
    value = getattr(incpt, name)
    methods = inspect.getmembers(value, inspect.isroutine) if inspect.isclass(value) else []
    public = {
        f"{name}.{key}": method for key, method in methods if not key.startswith("_") and callable(method)
    }
    return {name: value} | ({} if name == "Device" else public)


def _parameters(call: Callable[..., Any]) -> list[str]:
    named = (inspect.Parameter.POSITIONAL_OR_KEYWORD, inspect.Parameter.KEYWORD_ONLY)
    parameters = inspect.signature(call).parameters.values()
    return [one.name for one in parameters if one.name != "self" and one.kind in named]


KINDS = ("Error", "Warning")
PUBLIC = [name for name in incpt.__all__ if name not in MADE_BY_INCPT and not name.endswith(KINDS)]
CALLS = {key: call for name in PUBLIC for key, call in _functions(name).items()}


@pytest.fixture(scope="module")
def session(device: Device) -> incpt.Session:
    made = incpt.Session(SCENE, device=device)
    made.render(1)
    return made


def _call_of(name: str, session: incpt.Session) -> Callable[..., Any]:
    owner, dot, method = name.partition(".")
    if not dot:
        return getattr(incpt, name)  # type: ignore[no-any-return]
    instances = {
        "Bitmap": incpt.Bitmap(np.ones((2, 4, 3))),
        "Camera": SCENE.camera,
        "Scene": SCENE,
        "Session": session,
        "Transform": incpt.Transform(),
    }
    return getattr(instances.get(owner, getattr(incpt, owner)), method)  # type: ignore[no-any-return]


@pytest.fixture
def elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Files that are written by a name that happens to be one do no harm."""
    monkeypatch.chdir(tmp_path)


@pytest.mark.usefixtures("elsewhere")
@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize(
    ("name", "argument"), [(name, argument) for name, call in CALLS.items() for argument in _parameters(call)]
)
def test_a_wrong_argument_is_told_in_one_line(
    name: str, argument: str, session: incpt.Session, device: Device
) -> None:
    call, right = _call_of(name, session), dict(RIGHT.get(name, {}))
    if name == "Session":
        right["device"] = device
    refused = 0
    for kind, value in WRONG.items():
        if name == "Session.render" and argument == "spp" and isinstance(value, int):
            continue  # A million samples are right, but take their time.
        try:
            call(**{**right, argument: value})
        except (InputError, OutputError) as error:
            text = str(error)
            assert "\n" not in text and len(text) <= LONGEST_MESSAGE, kind
            # A path or a part that might be one is not the wrong argument, but leads to no file.
            if argument not in ("path", "part", "index") or kind not in ("a text", "None", "a number"):
                assert text.startswith(WORDS.get(argument, (argument,))), f"{name}({argument}={kind}): {text}"
            refused += isinstance(error, InputError)
        except Exception as error:
            raise AssertionError(f"{name}({argument}={kind}): {type(error).__name__}: {error}") from error
    assert refused >= 5  # no argument takes everything


ARRAY, CUBE, HUGE = np.zeros((4, 4, 3)), incpt.shape("cube"), 10**5000
EXAMPLES: list[tuple[str, Callable[[], object]]] = [
    ("camera: 'front' is not a Camera", lambda: incpt.Scene(camera="front")),
    ("environment: (1, 1, 1) is not an Environment", lambda: incpt.Scene(environment=(1, 1, 1))),
    ("materials: ['red'] is not a mapping of names to Materials", lambda: incpt.Scene(materials=["red"])),
    ("materials: (1, 0, 0) is not a Material", lambda: incpt.Scene(materials={"red": (1, 0, 0)})),
    ("materials: 1 is not a name; name each by a text", lambda: incpt.Scene(materials={1: incpt.Material()})),
    ("objects: a Mesh is not a list of Objects", lambda: incpt.Scene(objects=CUBE)),
    ("objects: 'cube' is not an Object", lambda: incpt.Scene(objects=["cube"])),
    ("objects: the class Object is not an Object", lambda: incpt.Scene(objects=[incpt.Object])),
    ("settings: {'nor': 4} is not RenderSettings", lambda: incpt.Scene(settings={"nor": 4})),
    ("objects: a Mesh is not an Object", lambda: SCENE.with_added(CUBE)),
    ("object 5 is not in the scene; it has floor, ", lambda: SCENE.with_object(5, visible=True)),
    ("object ['a'] is not in the scene; it has floor, ", lambda: SCENE.with_object(["a"])),
    ("name: ['a'] is not the name of a material", lambda: SCENE.with_material(["a"])),
    ("image: 'a' is not an Image; load_image() reads one", lambda: SCENE.with_environment(image="a")),
    ("mesh: an array of shape (4, 4, 3) is not a Mesh; use ", lambda: incpt.Object("a", ARRAY, "red")),
    ("name: None is not a name; give the object a text", lambda: incpt.Object(None, CUBE, "red")),
    ("lights: ['sun'] is not a Light", lambda: incpt.Scene(lights=[["sun"]])),
    ("power: an array of shape (4, 4, 3) is not a number", lambda: incpt.Light("a", "spot", power=ARRAY)),
    ("kind: 5 is not known; choose one of point, spot, sun, ", lambda: incpt.Light("a", 5)),
    ("vertices: 'cube' is not an array of numbers", lambda: incpt.Mesh("cube", [[0, 1, 2]])),
    ("faces: hold a number that is not whole, or beyond ", lambda: incpt.Mesh(np.eye(3), [[0, 1, 1.5]])),
    ("faces: hold a number that is not whole, or beyond ", lambda: incpt.Mesh(np.eye(3), [[0, 1, 2**32]])),
    ("position: an array of shape (3,) is not a number", lambda: incpt.Camera(position=np.zeros((3, 3)))),
    ("priority: a whole number of more than 64 bits is out ", lambda: incpt.Material(priority=HUGE)),
    ("size: 960 is not a pair of width and height, such as ", lambda: incpt.RenderSettings(size=960)),
    ("nor: an array of shape (4, 4, 3) is not a whole number", lambda: incpt.RenderSettings(nor=ARRAY)),
    ("scene: 'a.toml' is not a Scene; load() reads one", lambda: incpt.Session("a.toml")),
    ("settings: (16, 8) is not RenderSettings", lambda: incpt.Session(SCENE, settings=(16, 8))),
    ("device (index, or a part of its name): 0.5 is not a ", lambda: incpt.Session(SCENE, device=0.5)),
    ("path: a Scene is not a path; give a text or a Path", lambda: incpt.load(SCENE)),
    ("scene: 'a.toml' is not a Scene", lambda: incpt.save("a.toml", SCENE)),
    ("new: None is not a Scene", lambda: incpt.diff(SCENE, None)),
    ("shape 5 is not known; choose one of cube, ", lambda: incpt.shape(5)),
    ("path: an array of shape (4, 4, 3) is not a path; give ", lambda: incpt.write_exr(ARRAY, "a.exr")),
    ("layers: an array of shape (4, 4, 3) is not a mapping ", lambda: incpt.write_exr("a.exr", ARRAY)),
    ("path: an array of shape (4, 4, 3) is not a path; give ", lambda: incpt.write_png(ARRAY, "a.png")),
    ("image: 'a.png' is not an array of numbers", lambda: incpt.tone_map("a.png")),
    ("exposure: 2000 is out of range; use -1000 to 1000", lambda: incpt.tone_map(ARRAY, 2000)),
]


@pytest.mark.parametrize(("message", "call"), EXAMPLES, ids=[message for message, _ in EXAMPLES])
def test_messages_name_what_was_given_and_what_is_wanted(message: str, call: Callable[[], object]) -> None:
    with pytest.raises(InputError) as caught:
        call()
    assert str(caught.value).startswith(message)


def test_a_session_goes_on_after_wrong_arguments(session: incpt.Session) -> None:
    wrong: list[tuple[Callable[[], object], str]] = [
        (lambda: session.edit("red cube"), "scene: 'red cube' is not a Scene"),
        (lambda: session.edit(SCENE, since=5), "since: 5 is not a Scene"),
        (lambda: session.edit(SCENE, pixel=(1,)), "pixel: (1,) is not a pixel (x, y)"),
        (lambda: session.edit(SCENE, settings="fast"), "settings: 'fast' is not RenderSettings"),
        (lambda: session.configure(None), "settings: None is not RenderSettings"),
        (lambda: session.render("64"), "spp: '64' is not a whole number; use one from 0 on"),
        (lambda: session.render(1, on_step=5), "on_step: 5 is not a function"),
        (lambda: session.step(0), "slots: 0 is out of range; use a whole number from 1 on"),
        (lambda: session.restore(SCENE), "snapshot: a Scene is not a Snapshot; Session.snapshot makes one"),
        (lambda: session.first_hits(rows=5), "rows: 5 is not a pair of rows, such as (0, 100)"),
        (lambda: session.first_hits(rows=(0.5, 2)), "rows: 0.5 to 2 are no rows of 8; name one at least"),
        (lambda: session.pick("aa"), "pixel: 'aa' is not a pixel (x, y)"),
        (lambda: session.pick_point(None), "point: None is not a place (x, y) in the image"),
    ]
    before = session.image()
    for call, message in wrong:
        with pytest.raises(InputError) as caught:
            call()
        assert str(caught.value) == message
    assert session.scene == SCENE and np.array_equal(session.image(), before)


def test_objects_of_a_type_of_ones_own_are_objects() -> None:
    class Named(Object):
        """A program may add what it likes."""

    own = Named("own", incpt.shape("cube"), "red")
    assert SCENE.with_added(own).object("own") is own
