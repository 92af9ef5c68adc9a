"""`contbreather --install-completion`: commands and options by the tab key."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

from contbreather.errors import BadInput

if TYPE_CHECKING:
    from cyclopts import App


def offer(app: App) -> None:
    """Make the command part of an application."""

    def install(*, shell: Literal["bash", "zsh", "fish"] | None = None) -> None:
        """Complete commands and options by the tab key, in every new shell.

        Parameters
        ----------
        shell
            The one that this runs in unless given.
        """
        from cyclopts.completion import ShellDetectionError

        try:
            path = app.install_completion(shell=shell)
        except ShellDetectionError as error:
            raise BadInput(
                "this shell is not known; name one, as in --install-completion --shell bash"
            ) from error
        print(f"Wrote {path}; a new shell reads it.")

    app.command(install, name="--install-completion")
