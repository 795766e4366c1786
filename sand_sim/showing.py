"""Texts of strangers, as they may stand in logs and messages."""


def shown(text: str, most: int = 60) -> str:
    """A text without its middle where it has more than so many letters, and with a question mark for what cannot be printed."""
    text = text if len(text) <= most else text[: most // 2] + "..." + text[-most // 2 :]
    return "".join(letter if letter.isprintable() else "?" for letter in text)
