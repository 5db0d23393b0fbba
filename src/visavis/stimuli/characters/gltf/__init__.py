"""Characters from glTF files: read, told apart by what they are, and fitted to our joints."""

from visavis.stimuli.characters.gltf.importing import Gender, import_gltf

__all__ = ["Gender", "import_gltf"]
