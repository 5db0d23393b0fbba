"""Characters from glTF files: read, classified by kind of surface, and fitted to our joints."""

from visavis.stimuli.characters.gltf.importing import Gender, import_gltf

__all__ = ["Gender", "import_gltf"]
