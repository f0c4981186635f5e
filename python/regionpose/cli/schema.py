"""`regionpose schema`."""

from __future__ import annotations

from regionpose.cli.console import say_json


def schema() -> None:
    """Print the JSON schema of scene files, for editors and other validators.

    \b
    Examples:
      regionpose schema > scene.schema.json
      # first line of a scene file, for editors with YAML support:
      # yaml-language-server: $schema=scene.schema.json
    """
    from regionpose.scene.loading import scene_schema

    say_json(scene_schema())
