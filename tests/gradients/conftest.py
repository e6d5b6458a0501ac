"""What tests of gradients share."""
import pytest


@pytest.fixture
def load(tmp_path):
    """Load a scene of its text."""
    import mitsonar

    def loaded(text):
        path = tmp_path / "scene.xml"
        path.write_text(text, encoding="utf-8")
        return mitsonar.load_file(path)

    return loaded
