"""tools/deps derives the backports source from whatever apt sources the machine has."""

import unittest

import support

RELEASE = 'PRETTY_NAME="Debian"\nVERSION_CODENAME=bookworm\n'
EXPECTED = """Types: deb
URIs: http://mirror.example/debian
Suites: bookworm-backports
Components: main
"""


class BackportsTest(support.TreeTest):
    def derive(self, **files):
        self.write("etc/os-release", RELEASE)
        for name, text in files.items():
            folder, suffix = ("etc/apt", ".list") if name == "sources" else ("etc/apt/sources.list.d", "")
            self.write(f"{folder}/{name.replace('_', '.')}{suffix}", text)
        return self.run_tool("deps", "--print-backports", self.tree)

    def assert_derived(self, done, expected):
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertEqual(done.stdout, expected)

    def test_deb822_with_comments_inside_and_a_second_stanza(self):
        done = self.derive(debian_sources="""# the mirror of the house
Types: deb
# a comment within the stanza
URIs: http://mirror.example/debian
Suites: bookworm bookworm-updates
Components: main contrib
Signed-By: /usr/share/keyrings/key.gpg

Types: deb
URIs: http://mirror.example/debian-security
Suites: bookworm-security
Components: main
""")
        self.assert_derived(done, EXPECTED + "Signed-By: /usr/share/keyrings/key.gpg\n")

    def test_deb822_with_an_embedded_key_keeps_all_its_lines(self):
        key = " -----BEGIN PGP PUBLIC KEY BLOCK-----\n .\n mQINBGPL0BUBEADmW5NdOOHwPIJlgPu6JDcKw/NZJPR8lsD3K87ZM18gzyQZJD+w\n"
        done = self.derive(debian_sources=f"""Types: deb
URIs: http://mirror.example/debian
Suites: bookworm
Components: main
Signed-By:
{key}""")
        self.assert_derived(done, EXPECTED + "Signed-By:\n" + key)

    def test_a_disabled_stanza_and_sources_of_others_are_passed_over(self):
        done = self.derive(a_sources="""Types: deb
Enabled: no
URIs: http://wrong.example/debian
Suites: bookworm
Components: main
""", b_list="deb [arch=amd64] http://tool.example/packages stable main\n",
                           debian_list="deb-src http://wrong.example/debian bookworm main\n"
                                       "deb http://mirror.example/debian bookworm main # ours\n")
        self.assert_derived(done, EXPECTED)

    def test_one_line_with_options(self):
        done = self.derive(sources="""# deb cdrom:[Debian 12]/ bookworm main
deb [arch=amd64,arm64 signed-by=/etc/apt/keyrings/key.asc trusted=yes] http://mirror.example/debian bookworm main
deb http://mirror.example/debian bookworm-updates main
""")
        self.assert_derived(done, EXPECTED + "Architectures: amd64 arm64\nTrusted: yes\n"
                                             "Signed-By: /etc/apt/keyrings/key.asc\n")

    def test_a_cdrom_is_no_mirror(self):
        done = self.derive(sources="deb cdrom:/ bookworm main\ndeb http://mirror.example/debian bookworm main\n")
        self.assert_derived(done, EXPECTED)

    def test_backports_that_are_there_already_need_no_second_source(self):
        done = self.derive(debian_sources="""Types: deb
URIs: http://mirror.example/debian
Suites: bookworm bookworm-backports
Components: main
""")
        self.assertEqual((done.returncode, done.stdout), (2, ""))

    def test_our_own_file_does_not_count_as_configured(self):
        done = self.derive(rosid_backports_sources="", debian_list="deb http://mirror.example/debian bookworm main\n")
        self.write("etc/apt/sources.list.d/rosid-backports.sources", EXPECTED)
        again = self.run_tool("deps", "--print-backports", self.tree)
        self.assertEqual(done.stdout, again.stdout)
        self.assert_derived(again, EXPECTED)

    def test_no_source_of_this_release(self):
        self.assertEqual(self.derive(sources="deb http://mirror.example/debian trixie main\n").returncode, 1)
        self.assertEqual(self.derive().returncode, 1)


if __name__ == "__main__":
    unittest.main()
