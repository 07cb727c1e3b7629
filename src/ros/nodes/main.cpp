// The main function of every node: runs NODE, a function of this folder. They stand in the shells'
// library, where they are compiled together: for every program anew, reading ROS' headers would take
// longer than all else.
namespace tunnel_pilot::shell::node {
int NODE(int argc, char** argv);
}

int main(int argc, char** argv) { return tunnel_pilot::shell::node::NODE(argc, argv); }
