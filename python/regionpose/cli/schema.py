"""`regionpose schema`."""

from __future__ import annotations

from regionpose.cli.console import print_json


def schema() -> None:
    """Print the JSON schema of scene files.

    Editors that know it complete keys while you type.

    \b
    Examples:
      regionpose schema > scene.schema.json
      # first line of a scene file, for editors with YAML support:
      # yaml-language-server: $schema=scene.schema.json
    """
    from regionpose.scene.loading import scene_schema

    print_json(scene_schema())
