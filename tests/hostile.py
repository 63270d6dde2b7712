"""Names as an attacker or an accident makes them: of channels, files and materials."""

NAMES = (
    "R*/int evil(void){return 42;}/*",
    "//*/ int evil; /*",
    "ends in a backslash \\",
    "two\nlines\r\nfloat evil;\u2028float evil;",
    "a\0zero",
    "\x1b[31mred\x1b]0;title\x07",
    "\u202egnp.exe\u2066",
    "</script><img src=x onerror=alert(1)>",
    "{{script}} %s {0} ${x}",
    "{{nope}} @NOPE@ @VERSION@",
    # What ends the literal is the value of another mark, filled in later.
    '@NAME_TEXT@ """; import os; os.environ["HOMOFACT_EVIL"] = "1"; """',
    "@PROGRAM@ @DATA@ {{data}} {{css}} {{content}} $' $` $& $1",
    "'; import os; os.environ['HOMOFACT_EVIL'] = '1'; '",
    "*/ int evil; // `${globalThis.evil = 1}`",
    '=HYPERLINK("https://evil.example","x")',
    "@SUM(1+1)*cmd|' /C calc'!A0",
    "[click](javascript:alert(1)) ![x](https://evil.example/x.png) https://evil.example",
    "--> ]]> <!ENTITY x SYSTEM 'file:///etc/passwd'> &x;",
    "lone \udcff byte.csv",
    "\x08\x0b\x1f\x7f\x85\ufffe\uffff",
    "[/] [bold]x[/bold] :smile:",
    "| a | *b* `c` [d](javascript:e) <f>",
    "lone \ud800 surrogate",
    "\U000e0001tagged",
    "x" * 3000,
)
# What no generated text may hold, whatever a name holds: control, bidirectional, and what UTF-8 cannot write.
FORBIDDEN = "\0\x07\x08\x0b\x1b\x1f\x7f\x85\u2028\u202e\u2066\ud800\udcff\ufffe\uffff\U000e0001"
