"""Small whole files of the formats of lighting and optics, as text that tests change."""

import math

import numpy as np

# Y, X and Z (or R, G and B by wavelength) are these parts of one number.
SHARES = (1.0, 0.9, 0.8)
COARSE = """<AngleBasis><AngleBasisName>Coarse</AngleBasisName>
<AngleBasisBlock><nPhis>1</nPhis><ThetaBounds><LowerTheta>0</LowerTheta><UpperTheta>30</UpperTheta></ThetaBounds>
</AngleBasisBlock>
<AngleBasisBlock><nPhis>4</nPhis><ThetaBounds><LowerTheta>30</LowerTheta><UpperTheta>90</UpperTheta></ThetaBounds>
</AngleBasisBlock></AngleBasis>"""
# Of the file's axes: patch 1 is at azimuth 0, 2 at 90, 3 at 180, 4 at 270 degrees; rows are the viewer, columns the
# light by the direction opposite to it.
MATRIX = [[0.1 * view + 0.01 * light + 0.05 for light in range(5)] for view in range(5)]


def window_block(side: str, band: str, text: str, bases: str | None = None) -> str:
    named = "<ColumnAngleBasis>Coarse</ColumnAngleBasis><RowAngleBasis>Coarse</RowAngleBasis>"
    return (
        f"<WavelengthData><Wavelength>{band}</Wavelength><WavelengthDataBlock>"
        f"<WavelengthDataDirection>{side}</WavelengthDataDirection>{named if bases is None else bases}"
        f"<ScatteringData>\n{text}\n</ScatteringData></WavelengthDataBlock></WavelengthData>\n"
    )


def window(blocks: str, structure: str = "Columns", basis: str = COARSE) -> str:
    return (
        '<?xml version="1.0" encoding="UTF-8"?>\n<WindowElement xmlns="http://windows.lbl.gov">\n<Optical><Layer>\n'
        "<Material><Name>cloth</Name></Material>\n<DataDefinition>"
        f"<IncidentDataStructure>{structure}</IncidentDataStructure>{basis}</DataDefinition>\n{blocks}"
        "</Layer></Optical></WindowElement>"
    )


def matrix(share: float = 1.0) -> str:
    return "\n".join(", ".join(f"{share * x:.6g}" for x in row) + "," for row in MATRIX)


def coloured_window() -> str:
    bands = zip(("Visible", "CIE-X", "CIE-Z"), SHARES, strict=True)
    return window("".join(window_block("Reflection Front", band, matrix(share)) for band, share in bands))


SHIRLEY = "<AngleBasis>LBNL/Shirley-Chiu</AngleBasis>"


def tree_window(text: str, dimensions: int = 3, side: str = "Reflection Back") -> str:
    return window(window_block(side, "Visible", text, SHIRLEY), f"TensorTree{dimensions}", "")


INCIDENCES, AZIMUTHS, RADIALS = (0, 40), (0, 90, 180), (0, 10, 60)


def zemax_rows(share: float = 1.0) -> str:
    rows = []
    for k, _ in enumerate(INCIDENCES):
        rows.append(f"TIS {0.2 + 0.1 * k:g}")
        for j, _ in enumerate(AZIMUTHS):
            rows.append("\t".join(f"{share * (0.3 + 0.1 * k - 0.002 * x + 0.01 * j * (x > 0)):.6g}" for x in RADIALS))
    return "\n".join(rows)


def row(numbers: tuple[float, ...]) -> str:
    return "\t".join(f"{x:g}" for x in numbers)


def zemax(content: str = "Monochrome", symmetry: str = "PlaneSymmetrical", kind: str = "BRDF") -> str:
    names = ("Monochrome",) if content == "Monochrome" else ("TristimulusX", "TristimulusY", "TristimulusZ")
    shares = (1.0,) if content == "Monochrome" else (SHARES[1], SHARES[0], SHARES[2])
    blocks = "".join(
        f"{name}\nDataBegin\n{zemax_rows(share)}\nDataEnd\n" for name, share in zip(names, shares, strict=True)
    )
    head = f"# a coating\nSource  Measured\nSymmetry  {symmetry}\nSpectralContent  {content}\nScatterType  {kind}\n"
    angles = [("SampleRotation", (0,)), ("AngleOfIncidence", INCIDENCES), ("ScatterAzimuth", AZIMUTHS)]
    for key, each in [*angles, ("ScatterRadial", RADIALS)]:
        head += f"{key}  {len(each)}\n{row(each)}\n"
    return (head + "\n" + blocks).rstrip("\n")


THETAS, PHIS, WAVES, PERCENTS = (0, 30, 90), (0, 90, 180, 270, 360), (450, 550, 650), (20.0, 40.0, 60.0)


def speos_table(scale: float) -> str:
    rows = [f"{t}\t" + row((scale * (1 + math.cos(math.radians(t))),) * len(PHIS)) for t in THETAS]
    return f"{len(THETAS)}\t{len(PHIS)}\n\t{row(PHIS)}\n" + "\n".join(rows) + "\n"


def speos(flags: str = "1\t0", kind: str = "1", version: str = "v8.0", mode: str = "0") -> str:
    text = f"OPTIS - brdf surface file {version}\n{mode}\na coating\n5\n-----\n{flags}\n{kind}\n"
    text += f"{len(INCIDENCES)}\t{len(WAVES)}\n{row(INCIDENCES)}\n{row(WAVES)}\n"
    for _ in INCIDENCES:
        for percent in PERCENTS:
            text += f"{percent:g}\n{speos_table(0.7)}"
    return text + "End of file"


def anisotropic(flags: str = "1\t0", percents: tuple[float, ...] = PERCENTS) -> str:
    text = f"OPTIS - Anisotropic BSDF surface file v8.0\n0\na coating\n0\n\n0\t1\t0\n{flags}\n1\n2\n0\t90\n"
    text += f"{len(INCIDENCES)}\n{row(INCIDENCES)}\n" * 2 + f"0\t0\n\n{len(percents)}\n"
    text += "".join(f"{w}\t{p:g}\n" for w, p in zip(WAVES, percents, strict=True))
    return text + speos_table(0.7) * 2 + speos_table(1.4) * 2 + "End of file"


def pabopto(theta: float = 30, phi: float = 180, kind: str = "BSDF", name: str = "", colour: bool = False) -> str:
    head = f'#sample_name "{name}"\n' if name else ""
    head += f"#format: theta phi {kind}\n#intheta {theta:g}\n#inphi {phi:g}\n#upphi 90\n"
    head += "#colorimetry: CIE-XYZ\n" if colour else ""
    rows = []
    for t in np.arange(0, 90, 15):
        for p in (0, 90, 200):
            value = 0.1 + 0.01 * t + 0.001 * p
            shares = (0.9, 1, 0.8) if colour else (1,)
            rows.append(f"{t:g} {p} " + " ".join(f"{share * value:.6g}" for share in shares))
    return head + "\n".join(rows) + "\n"
