"""The default's way to find red cars, with enough window sets for every frame's turn."""

from red_cars import PERSPECTIVE
from vdet.config.schema import Settings


def _with_sizes(settings: Settings, *sizes: float) -> Settings:
    perspective = settings.svm.search.perspective.model_copy(update={"sizes": sizes})
    search = settings.svm.search.model_copy(update={"perspective": perspective})
    return settings.model_copy(
        update={"detector": settings.svm.model_copy(update={"search": search})}
    )


IN_TURNS = _with_sizes(PERSPECTIVE, 0.15, 0.2, 0.25)
"""Windows of 48, 64 and 80 pixels, all of which find `CAR`."""
