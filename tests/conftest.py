"""Settings for the whole suite: repeatable random tests, and the slow ones last."""

from hypothesis import HealthCheck, settings

settings.register_profile("sketchcore", deadline=None, derandomize=True, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("sketchcore")


def pytest_configure(config):
    config.addinivalue_line("markers", "slow: takes more than five seconds; runs after all others")


def pytest_collection_modifyitems(items):
    items.sort(key=lambda item: item.get_closest_marker("slow") is not None)
