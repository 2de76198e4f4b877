/* Prioritized planning in Java, without an SDK: the protocol of Fleetyard from nothing but
 * the standard library, one JSON object per line on standard input and output.
 *
 * Agents are planned one after the other, each by A* through space and time around the paths
 * of those before it (Silver, "Cooperative Pathfinding", AIIDE 2005). When one finds no path,
 * planning begins again with that one first, and in random orders after a while. There are
 * instances that no order solves.
 *
 * `one-by-one` beside this file starts it: `fleetyard run --planner ./one-by-one …`. It needs
 * Java 17 or later, and nothing of the sandbox that is not granted by default: 256 processes
 * (a virtual machine has about 15 threads) and half of the machine's memory, of which it has
 * to stay below `--memory` by itself, with `-Xmx`. It does not start with `--memory 96MiB` or
 * `--processes 12`; 128 MiB and 16 processes are enough. Starting and compiling this file
 * takes about a second of processor time, before the clock of the first call runs.
 */

import java.io.BufferedReader;
import java.io.IOException;
import java.io.InputStreamReader;
import java.io.PrintStream;
import java.nio.charset.StandardCharsets;
import java.util.ArrayList;
import java.util.Arrays;
import java.util.Collections;
import java.util.Comparator;
import java.util.HashMap;
import java.util.HashSet;
import java.util.LinkedHashMap;
import java.util.List;
import java.util.Map;
import java.util.PriorityQueue;
import java.util.Random;
import java.util.concurrent.LinkedBlockingQueue;

public final class OneByOne {
  private static final PrintStream OUT = new PrintStream(System.out, false, StandardCharsets.UTF_8);
  private static final LinkedBlockingQueue<String> REQUESTS = new LinkedBlockingQueue<>();

  /** The request that the host has cancelled. */
  private static volatile long cancelled = -1;

  public static void main(String[] arguments) throws InterruptedException {
    Thread reader = new Thread(OneByOne::read, "reader");
    reader.setDaemon(true);
    reader.start();
    Grid grid = null;
    while (true) {
      String line = REQUESTS.take();
      if (line.isEmpty()) {
        return; // the end of the input, or `exit`
      }
      Object id = null;
      try {
        Json request = new Json(Json.parse(line));
        id = request.map().get("id");
        boolean bare = !request.map().containsKey("params");
        Json params = bare ? new Json(object()) : request.get("params");
        switch (request.get("method").text()) {
          case "initialize" -> answer(id, object("protocol_version", 1, "plugins", List.of(ABOUT)));
          case "create" -> answer(id, create(params));
          case "prepare" -> {
            grid = null;
            grid = new Grid(params.get("environment"));
            answer(id, object("status", "solved"));
          }
          case "plan" -> {
            if (grid == null) {
              throw new Failure("invalid-input", "`plan` came before a successful `prepare`");
            }
            answer(id, new Search(grid, params, request.get("id").whole()).plan());
          }
          case "shutdown" -> answer(id, null);
          default -> refuse(id, -32601, "there is no such method");
        }
      } catch (Failure failure) {
        answer(id, object("status", failure.status, "message", failure.getMessage()));
      } catch (Json.Malformed error) {
        refuse(id, -32602, "not what the protocol says: " + error.getMessage());
      } catch (OutOfMemoryError error) {
        answer(id, object("status", "gave-up", "message", "out of memory"));
      } catch (RuntimeException error) {
        error.printStackTrace();
        answer(id, object("status", "internal-error", "message", error.toString()));
      }
    }
  }

  private static final Map<String, Object> ABOUT =
      object(
          "id", "one-by-one",
          "kind", "planner",
          "name", "One by one (Java example)",
          "version", "0.1.0",
          "license", "MIT OR Apache-2.0",
          "description",
              "Plans agents one after the other by A* in space and time around the paths of those "
                  + "before (Silver 2005).",
          "capabilities", List.of("grid", "pebble", "deterministic"));

  /** Refuses data that must be understood: this planner knows none. */
  private static void critical(Json input) {
    if (input.map().get("parts") == null) {
      return;
    }
    for (Object part : input.get("parts").list()) {
      if (Boolean.TRUE.equals(new Json(part).map().get("critical"))) {
        String id = new Json(part).get("id").text();
        throw new Failure("unsupported", "the critical part `" + id + "` is unknown");
      }
    }
  }

  private static Map<String, Object> create(Json params) {
    Object options = params.map().get("options");
    if (options != null && !new Json(options).map().isEmpty()) {
      throw new Failure("invalid-input", "options: this planner has none");
    }
    return object("status", "solved");
  }

  /** Reads lines. Only `$/cancel` and `exit` must be heard while a call is running. */
  private static void read() {
    try (BufferedReader input =
        new BufferedReader(new InputStreamReader(System.in, StandardCharsets.UTF_8))) {
      for (String line = input.readLine(); line != null; line = input.readLine()) {
        if (line.length() < 256 && line.contains("\"$/cancel\"")) {
          Json params = new Json(Json.parse(line)).get("params");
          cancelled = params.get("id").whole();
        } else if (line.length() < 256 && line.contains("\"exit\"")) {
          break;
        } else if (!line.isEmpty()) {
          REQUESTS.add(line);
        }
      }
    } catch (IOException | RuntimeException error) {
      System.err.println(error);
    }
    REQUESTS.add("");
  }

  private static void answer(Object id, Object result) {
    send(object("jsonrpc", "2.0", "id", id, "result", result));
  }

  private static void refuse(Object id, int code, String message) {
    Object error = object("code", code, "message", message);
    send(object("jsonrpc", "2.0", "id", id, "error", error));
  }

  private static void metric(String name, double value) {
    Object params = object("name", name, "value", value);
    send(object("jsonrpc", "2.0", "method", "metric", "params", params));
  }

  private static synchronized void send(Object message) {
    StringBuilder text = new StringBuilder();
    Json.write(message, text);
    OUT.print(text.append('\n'));
    OUT.flush();
  }

  /** An object of JSON from names and values in turn. */
  private static Map<String, Object> object(Object... members) {
    Map<String, Object> map = new LinkedHashMap<>();
    for (int i = 0; i < members.length; i += 2) {
      map.put((String) members[i], members[i + 1]);
    }
    return map;
  }

  /** Ends a call with a status other than solved. */
  private static final class Failure extends RuntimeException {
    private static final long serialVersionUID = 1;
    final String status;

    Failure(String status, String message) {
      super(message);
      this.status = status;
    }
  }

  // ---- The planner ------------------------------------------------------------

  /** A map; a cell is row * cols + col. */
  private static final class Grid {
    final int[][] neighbours;
    final boolean[] free;

    Grid(Json environment) {
      critical(environment);
      if (!environment.get("representation").text().equals("grid")) {
        throw new Failure("unsupported", "this planner knows grids only");
      }
      Json grid = environment.get("grid");
      if (grid.get("connectivity").whole() != 4 || grid.map().containsKey("moves")) {
        throw new Failure("unsupported", "this planner knows 4 neighbours and no one-way moves");
      }
      int rows = (int) grid.get("rows").whole();
      int cols = (int) grid.get("cols").whole();
      free = new boolean[rows * cols];
      neighbours = new int[rows * cols][];
      List<?> lines = grid.get("passable").list();
      for (int cell = 0; cell < free.length; cell++) {
        free[cell] = ((String) lines.get(cell / cols)).charAt(cell % cols) == '.';
      }
      for (int cell = 0; cell < free.length; cell++) {
        int[] near = new int[4];
        int count = 0;
        if (cell >= cols && free[cell - cols]) near[count++] = cell - cols;
        if (cell % cols + 1 < cols && free[cell + 1]) near[count++] = cell + 1;
        if (cell + cols < free.length && free[cell + cols]) near[count++] = cell + cols;
        if (cell % cols > 0 && free[cell - 1]) near[count++] = cell - 1;
        neighbours[cell] = Arrays.copyOf(near, count);
      }
    }

    /** Steps from every cell to a goal; -1 where no path leads to it. */
    int[] distances(int goal) {
      int[] distance = new int[free.length];
      int[] queue = new int[free.length];
      Arrays.fill(distance, -1);
      distance[goal] = 0;
      queue[0] = goal;
      for (int next = 0, end = 1; next < end; next++) {
        for (int near : neighbours[queue[next]]) {
          if (distance[near] < 0) {
            distance[near] = distance[queue[next]] + 1;
            queue[end++] = near;
          }
        }
      }
      return distance;
    }
  }

  /** A state of the search: a cell at a time. */
  private record State(int cell, int time, int arrival, State before) {}

  private static final Comparator<State> BEST_FIRST =
      Comparator.comparingInt(State::arrival).thenComparingInt(state -> -state.time());

  private static final class Search {
    private static final int NEVER = Integer.MAX_VALUE;

    private final Grid grid;
    private final long request;
    private final long stop;
    private final long nodes;
    private final Random random;
    private final int[] starts;
    private final int[] goals;
    private final int[][] distances;
    private long expansions = 0;

    // What those who have planned take: who is where by time and cell, from when on a cell is
    // somebody's goal, and the last time at which somebody is in a cell.
    private final Map<Long, Integer> taken = new HashMap<>();
    private final int[] parked;
    private final int[] lastUse;
    private int horizon;

    Search(Grid grid, Json params, long request) {
      this.grid = grid;
      this.request = request;
      Json instance = params.get("instance");
      Json budget = params.get("budget");
      critical(instance);
      // On Linux `nanoTime` is the clock of the budget, `CLOCK_MONOTONIC`.
      stop = budget.get("answer_by_ns").whole();
      nodes = budget.map().containsKey("nodes") ? budget.get("nodes").whole() : 0;
      random = new Random(budget.map().containsKey("seed") ? budget.get("seed").whole() : 0);
      starts = instance.get("starts").cells();
      List<?> lists = instance.get("goals").list();
      if (instance.map().containsKey("motion")
          && !instance.get("motion").text().equals("pebble")) {
        throw new Failure("unsupported", "this planner knows pebble motion only");
      }
      goals = new int[starts.length];
      distances = new int[starts.length][];
      parked = new int[grid.free.length];
      lastUse = new int[grid.free.length];
      HashSet<Integer> seen = new HashSet<>();
      HashSet<Integer> wanted = new HashSet<>();
      for (int agent = 0; agent < starts.length; agent++) {
        int[] own = new Json(lists.get(agent)).cells();
        if (own.length != 1) {
          throw new Failure("unsupported", "agent " + agent + " has not exactly one goal");
        }
        goals[agent] = own[0];
        if (!grid.free[starts[agent]] || !grid.free[goals[agent]] || !seen.add(starts[agent])) {
          throw new Failure(
              "invalid-input", "agent " + agent + " starts or ends on an obstacle or another one");
        }
        if (!wanted.add(goals[agent])) {
          throw new Failure("unsupported", "agent " + agent + " has the goal of another one");
        }
        distances[agent] = grid.distances(goals[agent]);
        if (distances[agent][starts[agent]] < 0) {
          throw new Failure("infeasible", "no path leads agent " + agent + " to its goal");
        }
        check();
      }
    }

    Map<String, Object> plan() {
      List<Integer> order = new ArrayList<>();
      for (int agent = 0; agent < starts.length; agent++) {
        order.add(agent);
      }
      order.sort(Comparator.comparingInt(agent -> distances[agent][starts[agent]]));
      int[][] paths = new int[starts.length][];
      for (int attempt = 1; ; attempt++) {
        int planned = attempt(order, paths);
        if (planned == order.size()) {
          metric("expansions", expansions);
          metric("attempts", attempt);
          return object("status", "solved", "paths", Arrays.asList(paths));
        }
        if (attempt % 32 == 0) {
          Collections.shuffle(order, random);
        } else {
          order.add(0, order.remove(planned));
        }
      }
    }

    /** Plans in an order; the number of agents before the first that found no path. */
    private int attempt(List<Integer> order, int[][] paths) {
      taken.clear();
      Arrays.fill(parked, NEVER);
      Arrays.fill(lastUse, -1);
      horizon = 0;
      for (int place = 0; place < order.size(); place++) {
        int agent = order.get(place);
        int[] path = path(agent);
        if (path == null) {
          return place;
        }
        for (int time = 0; time < path.length; time++) {
          taken.put(key(time, path[time]), agent);
          lastUse[path[time]] = Math.max(lastUse[path[time]], time);
        }
        parked[path[path.length - 1]] = path.length - 1;
        horizon = Math.max(horizon, path.length);
        paths[agent] = path;
      }
      return order.size();
    }

    private int[] path(int agent) {
      int[] distance = distances[agent];
      int goal = goals[agent];
      PriorityQueue<State> open = new PriorityQueue<>(BEST_FIRST);
      HashSet<Long> closed = new HashSet<>();
      if (!blocked(starts[agent], 0)) {
        open.add(new State(starts[agent], 0, distance[starts[agent]], null));
      }
      while (!open.isEmpty()) {
        State state = open.poll();
        if (state.cell == goal && state.time > lastUse[goal]) {
          int[] path = new int[state.time + 1];
          for (State at = state; at != null; at = at.before) {
            path[at.time] = at.cell;
          }
          return path;
        }
        // Nobody moves after the horizon, so a cell need not be seen twice from then on.
        if (!closed.add(key(Math.min(state.time, horizon), state.cell))) {
          continue;
        }
        expansions++;
        if (nodes > 0 && expansions > nodes) {
          throw new Failure("gave-up", "the limit of search nodes is reached");
        }
        if (expansions % 256 == 0) {
          check();
        }
        step(open, state, state.cell, distance);
        for (int near : grid.neighbours[state.cell]) {
          step(open, state, near, distance);
        }
      }
      return null;
    }

    private void step(PriorityQueue<State> open, State from, int to, int[] distance) {
      int time = from.time + 1;
      Integer other = taken.get(key(from.time, to));
      boolean swap = other != null && other.equals(taken.get(key(time, from.cell)));
      if (!swap && !blocked(to, time)) {
        open.add(new State(to, time, time + distance[to], from));
      }
    }

    private boolean blocked(int cell, int time) {
      return parked[cell] <= time || taken.containsKey(key(time, cell));
    }

    private static long key(int time, int cell) {
      return (long) time << 32 | cell;
    }

    private void check() {
      if (cancelled == request) {
        throw new Failure("cancelled", "cancelled by the host");
      }
      if (System.nanoTime() - stop >= 0) {
        throw new Failure("timed-out", "no plan before the end of the budget");
      }
    }
  }

  // ---- JSON -------------------------------------------------------------------

  /** A value of JSON: a map, a list, a string, a number, a truth value or null. */
  private record Json(Object value) {
    static final class Malformed extends RuntimeException {
      private static final long serialVersionUID = 1;

      Malformed(String message) {
        super(message);
      }
    }

    Map<?, ?> map() {
      return as(Map.class, "an object");
    }

    List<?> list() {
      return as(List.class, "a list");
    }

    String text() {
      return as(String.class, "a string");
    }

    long whole() {
      return as(Long.class, "a whole number");
    }

    int[] cells() {
      return list().stream().mapToInt(cell -> Math.toIntExact(new Json(cell).whole())).toArray();
    }

    private <T> T as(Class<T> type, String name) {
      if (!type.isInstance(value)) {
        throw new Malformed(value + " is not " + name);
      }
      return type.cast(value);
    }

    Json get(String name) {
      if (!map().containsKey(name)) {
        throw new Malformed("`" + name + "` is missing");
      }
      return new Json(map().get(name));
    }

    static Object parse(String text) {
      Reader reader = new Reader(text);
      Object value = reader.value(0);
      reader.blank();
      if (reader.at != text.length()) {
        throw reader.malformed("something follows the end");
      }
      return value;
    }

    static void write(Object value, StringBuilder out) {
      if (value instanceof Map<?, ?> map) {
        String separator = "{";
        for (Map.Entry<?, ?> entry : map.entrySet()) {
          out.append(separator);
          write(entry.getKey(), out);
          out.append(':');
          write(entry.getValue(), out);
          separator = ",";
        }
        out.append(map.isEmpty() ? "{}" : "}");
      } else if (value instanceof List<?> list) {
        out.append('[');
        for (int i = 0; i < list.size(); i++) {
          if (i > 0) out.append(',');
          write(list.get(i), out);
        }
        out.append(']');
      } else if (value instanceof int[] cells) {
        write(Arrays.stream(cells).boxed().toList(), out);
      } else if (value instanceof String text) {
        out.append('"');
        for (char c : text.toCharArray()) {
          if (c == '"' || c == '\\') {
            out.append('\\').append(c);
          } else if (c < 0x20 || Character.isSurrogate(c)) {
            out.append(String.format("\\u%04x", (int) c));
          } else {
            out.append(c);
          }
        }
        out.append('"');
      } else {
        out.append(value); // numbers, truth values and null
      }
    }

    private static final class Reader {
      private final String text;
      private int at = 0;

      Reader(String text) {
        this.text = text;
      }

      Malformed malformed(String reason) {
        return new Malformed("malformed JSON at character " + at + ": " + reason);
      }

      private char peek() {
        return at < text.length() ? text.charAt(at) : '\0';
      }

      private void blank() {
        while (at < text.length() && " \t\r\n".indexOf(text.charAt(at)) >= 0) {
          at++;
        }
      }

      private boolean take(char wanted) {
        blank();
        if (at >= text.length() || text.charAt(at) != wanted) {
          return false;
        }
        at++;
        return true;
      }

      private void expect(char wanted) {
        if (!take(wanted)) {
          throw malformed("`" + wanted + "` is missing");
        }
      }

      Object value(int depth) {
        if (depth > 100) {
          throw malformed("too deep");
        }
        blank();
        switch (peek()) {
          case '{' -> {
            Map<String, Object> map = new LinkedHashMap<>();
            at++;
            if (!take('}')) {
              do {
                blank();
                String name = string();
                expect(':');
                if (map.containsKey(name)) {
                  throw malformed("`" + name + "` is there twice");
                }
                map.put(name, value(depth + 1));
              } while (take(','));
              expect('}');
            }
            return map;
          }
          case '[' -> {
            List<Object> list = new ArrayList<>();
            at++;
            if (!take(']')) {
              do {
                list.add(value(depth + 1));
              } while (take(','));
              expect(']');
            }
            return list;
          }
          case '"' -> {
            return string();
          }
          default -> {
            return literal();
          }
        }
      }

      private Object literal() {
        int begin = at;
        while (at < text.length() && ",]}: \t\r\n".indexOf(text.charAt(at)) < 0) {
          at++;
        }
        String word = text.substring(begin, at);
        switch (word) {
          case "true":
            return true;
          case "false":
            return false;
          case "null":
            return null;
          default:
            if (!word.matches("-?(0|[1-9][0-9]*)(\\.[0-9]+)?([eE][-+]?[0-9]+)?")) {
              throw malformed("no value");
            }
            return number(word);
        }
      }

      /** Whole numbers as a long, for the protocol has none from 2^53 on; others not. */
      private static Object number(String word) {
        try {
          return Long.parseLong(word);
        } catch (NumberFormatException error) {
          return Double.parseDouble(word);
        }
      }

      private String string() {
        if (peek() != '"') {
          throw malformed("no string");
        }
        at++;
        StringBuilder out = new StringBuilder();
        while (true) {
          if (at >= text.length() || peek() < 0x20) {
            throw malformed("a string without an end, or with a control character");
          }
          char c = text.charAt(at++);
          if (c == '"') {
            return out.toString();
          }
          if (c != '\\') {
            out.append(c);
            continue;
          }
          char letter = peek();
          at++;
          int known = "\"\\/bfnrt".indexOf(letter);
          if (known >= 0) {
            out.append("\"\\/\b\f\n\r\t".charAt(known));
          } else if (letter == 'u' && text.substring(at).matches("(?s)[0-9a-fA-F]{4}.*")) {
            out.append((char) Integer.parseInt(text.substring(at, at + 4), 16));
            at += 4;
          } else {
            throw malformed("an unknown escape");
          }
        }
      }
    }
  }
}
