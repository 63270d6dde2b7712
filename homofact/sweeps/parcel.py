"""Files and folders as bytes, to send them where there is no common file system: ZIP archives in memory."""

import io
import zipfile
from pathlib import Path

_SAME_TIME = (1980, 1, 1, 0, 0, 0)


def packed(place: Path) -> bytes:
    """Return a file, or a folder with its contents, packed as bytes. Raises OSError if it cannot be read."""
    stream = io.BytesIO()
    files = sorted(path for path in place.rglob("*") if path.is_file()) if place.is_dir() else [place]
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as archive:
        for file in files:
            name = zipfile.ZipInfo(str(file.relative_to(place.parent)), _SAME_TIME)
            archive.writestr(name, file.read_bytes(), zipfile.ZIP_DEFLATED)
    return stream.getvalue()


def unpacked(parcel: bytes, folder: Path) -> Path:
    """Unpack a parcel into `folder`; return the path of its file or folder. Raises OSError."""
    with zipfile.ZipFile(io.BytesIO(parcel)) as archive:
        names = archive.namelist()
        archive.extractall(folder)
    return folder / Path(names[0]).parts[0]
