"""Laws of the arm in the scene of the studio: a mesh for each part, moved and not made anew."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from softreach.studio.scene.scene import Scene
from tests.made_arms import MADE_ARMS


class Meshes:
    """Takes the place of viser's scene and keeps what is added."""

    def __init__(self):
        self.added = {}

    def add_mesh_simple(self, path, vertices, faces, **style):
        self.added[path] = SimpleNamespace(vertices=vertices, faces=faces, **style)
        return self.added[path]

    def get_handle_by_name(self, path):
        return self.added.get(path)


@pytest.mark.parametrize("kind", MADE_ARMS)
def test_every_kind_of_arm_is_drawn_and_moves(kind):
    arm, meshes = MADE_ARMS[kind](), Meshes()
    scene = Scene(meshes)
    low, high = arm.bounds.T
    scene.draw_arm(arm, np.zeros(arm.bundles).tolist())
    assert len(meshes.added) == 1 + arm.bundles
    at_rest = {path: mesh.vertices for path, mesh in meshes.added.items()}
    scene.draw_arm(arm, (0.2 * (low + high)).tolist())
    for path, mesh in meshes.added.items():
        assert mesh.vertices.shape == at_rest[path].shape
        assert not np.allclose(mesh.vertices, at_rest[path], atol=1e-6)


def test_a_body_is_clear_only_where_it_hides_a_bundle():
    def opacity(kind):
        meshes = Meshes()
        arm = MADE_ARMS[kind]()
        Scene(meshes).draw_arm(arm, np.zeros(arm.bundles).tolist())
        return [meshes.added[path].opacity for path in sorted(meshes.added)]

    body, *bundles = opacity("chamber")
    assert 0 < body < 1
    assert bundles == [None] * 3
    assert opacity("fiber") == [None] * 4
