// Asks lcm-spy's own table of types what it knows: arguments are fingerprints in hexadecimal, one line of answer each.

class SpyTypes {
    public static void main(String[] arguments) {
        lcm.spy.LCMTypeDatabase types = new lcm.spy.LCMTypeDatabase();
        for (String argument : arguments) {
            Class<?> found = types.getClassByFingerprint(Long.parseUnsignedLong(argument, 16));
            System.out.println(argument + " " + (found == null ? "unknown" : found.getName()));
        }
    }
}
