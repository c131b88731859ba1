"""Tiny data sets that trainings of both sides read, made once by the reference."""

RECIPES = {
    # 500 to 700 particles a scene.
    "random": ("hgn.json", ["frames=12", "counts.train=3", "counts.valid=1", "counts.test=1", "groups.size=0.04"]),
    "sweep": ("nsf_jelly_quick.json", ["scene.frames=20"]),
}


def generate_words(kind, folder, device="cpu"):
    recipe, changes = RECIPES[kind]
    words = ["graupel", "generate", f"scenes/recipes/{recipe}", "-o", folder, "--device", device, "--seed", 5]
    return words + [word for change in changes for word in ("--set", change)]


def data_set(kind, context):
    folder = context.work / "data" / kind
    if not folder.exists():
        context.reference.run(generate_words(kind, folder), context.inputs)
    return folder
